"""A Thorlabs PM100 power meter and its photodiode head."""
