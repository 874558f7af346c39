"""The Thorlabs PM100 family of power meters."""
