"""Thorlabs APT controllers and their motors."""
