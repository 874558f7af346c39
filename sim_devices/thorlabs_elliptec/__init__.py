"""Thorlabs Elliptec modules on one bus."""
