"""Cameras: what takes pictures of the sample behind the analyzer."""
