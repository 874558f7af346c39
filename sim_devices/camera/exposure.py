"""What a camera is asked for, and what it has no means for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import parse_qsl

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE]-?\d{1,3})?", re.ASCII)
_LONGEST_QUERY = 512
_QUOTED = 40


class Refused(Exception):
    """A request that is not done; `status` is that of HTTP, and the text says why."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclass(frozen=True)
class Exposure:
    """An exposure as the camera makes it: its time in whole microseconds, its gain in tenths of a decibel."""

    start_s: float
    exposure_s: float
    gain_db: float
    bits: int

    @property
    def middle_s(self) -> float:
        """On the bench's clock."""
        return self.start_s + self.exposure_s / 2


@dataclass(frozen=True)
class Means:
    """What a camera can be asked for: the depths of its files, and where exposure and gain begin and end."""

    bits: tuple[int, ...]
    exposure_s: tuple[float, float] = (1e-5, 60.0)
    gain_db: tuple[float, float] = (0.0, 24.0)
    usual_exposure_s: float = 0.02

    def exposure(self, query: str, start_s: float, names: tuple[str, ...]) -> Exposure:
        """Read the query of a request that may name some of `names`; what it does not name is the usual.

        Raises
        ------
        Refused
            With status 400, for a value that cannot be had, saying which one and what is allowed.
        """
        asked = _asked(query, names)
        exposure_s = _within("exposure_s", asked, self.usual_exposure_s, self.exposure_s)
        gain_db = _within("gain_db", asked, 0.0, self.gain_db)
        bits = asked.get("bits", str(self.bits[-1]))
        if bits not in map(str, self.bits):
            allowed = ", ".join(map(str, self.bits))
            raise Refused(400, f"bits={_short(bits)} cannot be had; allowed: {allowed}. No picture was taken.")
        return Exposure(start_s, round(exposure_s, 6), round(gain_db, 1), int(bits))


def _asked(query: str, names: tuple[str, ...]) -> dict[str, str]:
    if len(query) > _LONGEST_QUERY:
        raise Refused(400, f"the query is longer than {_LONGEST_QUERY} characters. No picture was taken.")
    asked: dict[str, str] = {}
    for name, value in parse_qsl(query, keep_blank_values=True):
        if name not in names:
            raise Refused(400, f"there is no {_short(name)}; allowed: {', '.join(names)}. No picture was taken.")
        if name in asked:
            raise Refused(400, f"{name} is given twice; give it once. No picture was taken.")
        asked[name] = value
    return asked


def _within(name: str, asked: Mapping[str, str], usual: float, limits: tuple[float, float]) -> float:
    text = asked.get(name)
    if text is None:
        return usual
    least, most = limits
    if _NUMBER.fullmatch(text) is None or not least <= float(text) <= most:
        raise Refused(
            400, f"{name}={_short(text)} cannot be had; allowed: {least:g} to {most:g}. No picture was taken."
        )
    return float(text)


def _short(text: str) -> str:
    printable = text.encode("ascii", "backslashreplace").decode()
    return printable if len(printable) <= _QUOTED else printable[:_QUOTED] + "..."
