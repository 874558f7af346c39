"""Thorlabs Elliptec rotators and sliders, several on one bus."""
