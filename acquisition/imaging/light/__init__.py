"""From a camera's frames to the light that reached every pixel: what the sensor adds is taken out."""
