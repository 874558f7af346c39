"""Fits of many pixels at once."""
