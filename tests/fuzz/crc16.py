"""The checksum of Modbus RTU by long division, bit after bit, independent of the tables of driver and emulator."""

from __future__ import annotations


def crc16(data: bytes) -> bytes:
    """Return the two bytes that follow `data` in a frame, the low one first."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            carry, register = register & 1, register >> 1
            if carry:
                register ^= 0xA001
    return bytes((register & 0xFF, register >> 8))


def framed(body: bytes) -> bytes:
    """Add the checksum to a frame's body."""
    return body + crc16(body)
