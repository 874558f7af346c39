"""Modbus as its masters speak it: frames, a port, and one unit behind it."""
