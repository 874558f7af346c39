"""What may become of a valid frame on a wire, and the pieces in which it may arrive."""

from __future__ import annotations

import random
from collections.abc import Sequence

_LONGEST_RUN = 300


class Mutator:
    """A seeded source of byte strings that resemble valid frames.

    Parameters
    ----------
    frames : sequence of bytes
        Valid frames, of which parts are spliced into others; it may grow while the mutator is in use.
    random_ : random.Random
        Where chance comes from.
    """

    def __init__(self, frames: Sequence[bytes], random_: random.Random) -> None:
        self._frames, self._random = frames, random_
        self._kinds = (
            self._flip,
            self._flip,
            self._replace,
            self._truncate,
            self._double,
            self._splice,
            self._insert,
            self._swap,
            self._run,
        )

    def string(self) -> bytes:
        """One of the frames, mutated."""
        return self.mutated(self._random.choice(self._frames))

    def mutated(self, frame: bytes) -> bytes:
        """A frame after one to three mishaps; of eight frames, one stays whole."""
        if self._random.random() < 1 / 8:
            return frame
        for _ in range(self._below(3) + 1):
            frame = self._random.choice(self._kinds)(frame)
        return frame

    def pieces(self, data: bytes) -> list[bytes]:
        """The same bytes whole, one by one, or cut at random."""
        way = self._random.random()
        if way < 0.4 or len(data) < 2:
            return [data]
        if way < 0.6:
            return [data[place : place + 1] for place in range(len(data))]
        cuts = sorted(self._below(len(data)) for _ in range(self._below(4) + 1))
        return [data[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(data)], strict=True) if begin < end]

    def _below(self, limit: int) -> int:
        return int(self._random.random() * limit)

    def _span(self, data: bytes) -> tuple[int, int]:
        first, last = self._below(len(data) + 1), self._below(len(data) + 1)
        return (first, last) if first <= last else (last, first)

    def _flip(self, data: bytes) -> bytes:
        if not data:
            return data
        place = self._below(len(data))
        return data[:place] + bytes([data[place] ^ 1 << self._below(8)]) + data[place + 1 :]

    def _replace(self, data: bytes) -> bytes:
        begin, end = self._span(data)
        return data[:begin] + self._random.randbytes(min(end - begin, 4)) + data[end:]

    def _truncate(self, data: bytes) -> bytes:
        begin, end = self._span(data)
        return data[begin:] if self._random.random() < 0.3 else data[:end]

    def _double(self, data: bytes) -> bytes:
        begin, end = self._span(data)
        return data[:end] + data[begin:end] + data[end:]

    def _splice(self, data: bytes) -> bytes:
        other = self._random.choice(self._frames)
        begin, end = self._span(other)
        place = self._below(len(data) + 1)
        return data[:place] + other[begin:end] + data[place:]

    def _insert(self, data: bytes) -> bytes:
        place = self._below(len(data) + 1)
        return data[:place] + self._random.randbytes(self._below(4) + 1) + data[place:]

    def _swap(self, data: bytes) -> bytes:
        begin, end = self._span(data)
        middle = (begin + end) // 2
        return data[:begin] + data[middle:end] + data[begin:middle] + data[end:]

    def _run(self, data: bytes) -> bytes:
        place = self._below(len(data) + 1)
        again = data[place : place + 1] or self._random.randbytes(1)
        length = self._below(8) if self._random.random() < 0.9 else self._below(_LONGEST_RUN)
        return data[:place] + again * length + data[place:]
