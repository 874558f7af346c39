"""Cutting the bytes that come into frames: a taker removes the first whole frame, or returns None for "need more"."""

from __future__ import annotations


def take_frame(received: bytearray, terminator: bytes) -> bytes | None:
    """Remove the first whole frame from `received` and return it without its terminator; None when more is needed."""
    end = received.find(terminator)
    if end < 0:
        return None
    frame = bytes(received[:end])
    del received[: end + len(terminator)]
    return frame


def take_exactly(received: bytearray, length: int) -> bytes | None:
    """Remove the first `length` bytes from `received` and return them; None when more is needed."""
    if len(received) < length:
        return None
    frame = bytes(received[:length])
    del received[:length]
    return frame
