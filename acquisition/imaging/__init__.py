"""Imaging polarimetry: from camera frames to Stokes parameters of every pixel of the sample."""
