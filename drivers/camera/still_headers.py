"""What a camera says of a still picture in the headers of its answer."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from goniometer.errors import ReplyError

NUMBER, START, EXPOSURE, GAIN = "X-Frame-Number", "X-Exposure-Start-s", "X-Exposure-s", "X-Gain-dB"
_UNCHECKED = {
    NUMBER: "that a picture is new, and that none was lost, is not checked",
    START: "that a picture was taken when it was asked for is not checked",
    EXPOSURE: "that exposures are as asked is not checked",
    GAIN: "that the gain is as asked is not checked",
}
_DECIMAL = re.compile(r"[+-]?(\d{1,30}(\.\d{0,30})?|\.\d{1,30})([eE][+-]?\d{1,3})?", re.ASCII)
_WHOLE = re.compile(r"\d{1,18}", re.ASCII)


@dataclass(frozen=True)
class StillHeaders:
    """Each is None where the camera does not say: number of the frame, start on its own clock, exposure and gain."""

    number: int | None
    start_s: float | None
    exposure_s: float | None
    gain_db: float | None

    @property
    def missing(self) -> tuple[str, ...]:
        """The headers that did not come."""
        values = self.number, self.start_s, self.exposure_s, self.gain_db
        return tuple(name for name, value in zip(_UNCHECKED, values, strict=True) if value is None)

    def unchecked(self) -> Iterator[str]:
        """What a person should know is not checked, because the camera does not say it."""
        return (f"the camera does not say {name}: {_UNCHECKED[name]}" for name in self.missing)


def read_headers(device: str, headers: Mapping[str, str]) -> StillHeaders:
    """Read the headers, whose names are in lower case; raises ReplyError for one that is not a number."""

    def text(name: str, form: re.Pattern[str]) -> str | None:
        value = headers.get(name.lower())
        if value is not None and (form.fullmatch(value) is None or not math.isfinite(float(value))):
            raise ReplyError(
                device,
                f"the camera has sent {name}: {value[:80]!r}, which is no such number",
                not_done="the picture was thrown away",
                to_do="look at the camera's firmware; a camera that does not send this header is taken without it",
            )
        return value

    number = text(NUMBER, _WHOLE)
    start_s, exposure_s, gain_db = (text(name, _DECIMAL) for name in (START, EXPOSURE, GAIN))
    return StillHeaders(
        None if number is None else int(number),
        None if start_s is None else float(start_s),
        None if exposure_s is None else float(exposure_s),
        None if gain_db is None else float(gain_db),
    )
