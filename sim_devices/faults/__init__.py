"""What goes wrong in a laboratory, on purpose: one concept a file, and no code on any path until a fault is named.

A fault is a section of the scene, or a request to the control socket. Once its time has come it strikes: it stands
between a device's sessions and their port, calls what can happen to a device, or darkens the light.
"""
