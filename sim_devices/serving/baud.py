"""The time that bytes take on a serial line."""

from __future__ import annotations

# eight bits between a start and a stop bit
_BITS = 10


class SerialLine:
    """One direction of a serial line, on which bytes follow one another.

    Parameters
    ----------
    baudrate : int
        Bits per second.
    """

    def __init__(self, baudrate: int) -> None:
        self.set(baudrate)
        self._free_s = float("-inf")

    def set(self, baudrate: int) -> None:
        """Change its speed."""
        self._byte_s = _BITS / baudrate

    def carry(self, count: int, now_s: float) -> float:
        """Put `count` bytes on the line, behind those that are still on it; when the last of them has arrived."""
        self._free_s = max(self._free_s, now_s) + count * self._byte_s
        return self._free_s
