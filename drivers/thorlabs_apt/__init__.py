"""Thorlabs controllers that speak APT: K10CR1, BSC201, KDC101."""
