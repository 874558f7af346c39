"""Cutting a stream of bytes into lines."""

from __future__ import annotations


class LineSplitter:
    """Collects bytes until a terminator has come.

    Parameters
    ----------
    terminator : bytes
        One byte that ends a line.
    limit : int
        Longest line that is kept; of a longer one the rest is dropped, so that no client can fill the memory.
    """

    def __init__(self, terminator: bytes, limit: int) -> None:
        self._terminator, self._limit = terminator, limit
        self._unfinished = b""

    def feed(self, data: bytes) -> list[str]:
        """Lines that are complete now, without their terminator; each byte becomes the character of its number."""
        *lines, rest = (self._unfinished + data).split(self._terminator)
        self._unfinished = rest[: self._limit]
        return [line[: self._limit].decode("latin-1") for line in lines]
