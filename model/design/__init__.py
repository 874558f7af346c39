"""What readings will tell of a surface, and which to take."""
