"""What a camera says of itself in its status.json."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from goniometer.errors import ReplyError

Range = tuple[float, float]
_EVERY: Range = (-math.inf, math.inf)


@dataclass(frozen=True)
class CameraStatus:
    """Each is None, or without limits, where the camera does not say."""

    model: str | None = None
    serial: str | None = None
    width: int | None = None
    height: int | None = None
    bits: tuple[int, ...] | None = None
    exposure_s: Range = _EVERY
    gain_db: Range = _EVERY

    @property
    def identity(self) -> str:
        """Model and serial number; empty when it says neither."""
        serial = None if self.serial is None else f"serial {self.serial}"
        return ", ".join(part for part in (self.model, serial) if part)

    def contradictions(self, *, width: int, height: int, bits: int, gain_db: float) -> Iterator[str]:
        """Where it is another camera than the rig file describes."""
        if (self.width or width, self.height or height) != (width, height):
            yield f"its pictures have {self.width} x {self.height} pixels, not {width} x {height} (width_px, height_px)"
        if self.bits is not None and bits not in self.bits:
            yield f"it gives {' or '.join(map(str, self.bits))} bits, not {bits} (bits)"
        low_db, high_db = self.gain_db
        if not low_db <= gain_db <= high_db:
            yield f"its gain goes from {low_db:g} to {high_db:g} dB, not to {gain_db:g} dB (gain_db)"


def parse_status(device: str, text: bytes) -> CameraStatus:
    """Read a status.json; raises ReplyError when it is broken or a value is of another kind."""
    try:
        found = json.loads(text)
        if not isinstance(found, dict):
            raise ValueError("it is no object")  # noqa: TRY004 (what a file holds is no type of ours)
        return CameraStatus(
            model=_text(found, "model"),
            serial=_text(found, "serial"),
            width=_size(found, "width"),
            height=_size(found, "height"),
            bits=_depths(found, "bits"),
            exposure_s=_range(found, "exposure_s"),
            gain_db=_range(found, "gain_db"),
        )
    except (ValueError, OverflowError, RecursionError) as error:
        raise ReplyError(
            device,
            f"the camera has sent a status.json that cannot be read ({error})",
            not_done="the camera was not set up",
            to_do="open status.json at the camera's address in a browser; check that the address is the camera's",
        ) from None


def _text(found: dict[str, Any], key: str) -> str | None:
    value = found.get(key)
    if value is not None and not isinstance(value, str | int):
        raise ValueError(f"{key} is no text")
    return None if value is None else str(value)[:80]


def _size(found: dict[str, Any], key: str) -> int | None:
    value = found.get(key)
    if value is not None and not (isinstance(value, int) and value > 0):
        raise ValueError(f"{key} is no number of pixels")
    return value


def _depths(found: dict[str, Any], key: str) -> tuple[int, ...] | None:
    value = found.get(key)
    if value is None:
        return None
    if not (isinstance(value, list) and value and all(isinstance(depth, int) for depth in value)):
        raise ValueError(f"{key} is no list of numbers of bits")
    return tuple(value)


def _range(found: dict[str, Any], key: str) -> Range:
    value = found.get(key)
    if value is None:
        return _EVERY
    is_pair = isinstance(value, list) and len(value) == 2 and all(isinstance(end, int | float) for end in value)
    if not (is_pair and value[0] <= value[1]):
        raise ValueError(f"{key} is no pair of the lowest and the highest value")
    return float(value[0]), float(value[1])
