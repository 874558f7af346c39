"""Physics, numerics and fitting of polarized reflectance: arrays in, arrays out; angles in radians."""
