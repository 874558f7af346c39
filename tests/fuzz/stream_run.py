"""Mutated frames one behind the other, and a parser that cuts them out of what has arrived."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

from mutation import Mutator

from drivers.wire.framing import take_frame

_LONGEST_LEFT = 8192


class StreamRun:
    """Bytes that arrive in pieces, and a taker that cuts frames out of them."""

    def __init__(
        self, frames: Sequence[bytes], random_: random.Random, take: Callable[[bytearray, bytes], str]
    ) -> None:
        self._mutator, self._take = Mutator(frames, random_), take
        self._received, self._before = bytearray(), b""

    def take(self) -> str:
        """Feed a string; `take` is called with what has arrived, and all that ever came near it."""
        data = self._mutator.string()
        near, outcome = self._before + data, "nothing"
        for piece in self._mutator.pieces(data):
            self._received += piece
            while (word := self._take(self._received, near)) != "more":
                outcome = word
        assert len(self._received) <= _LONGEST_LEFT
        self._before = near[-600:]
        return outcome


def lines(
    frames: Sequence[bytes], terminator: bytes, read: Callable[[bytes], str]
) -> Callable[[random.Random], StreamRun]:
    def take(received: bytearray, near: bytes) -> str:
        frame = take_frame(received, terminator)
        if frame is None:
            if len(received) > 4096:  # as a link does
                received.clear()
            return "more"
        assert terminator not in frame
        assert frame + terminator in near or len(near) >= 600
        return read(frame)

    return lambda random_: StreamRun(frames, random_, take)
