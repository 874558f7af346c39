"""Bytes to and from a device: ports, the link that owns one, frames, texts, and the log of the wire."""
