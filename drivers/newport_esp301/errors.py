"""Error reports of a Newport ESP300 or ESP301: the lines that answer ``TB?`` and what their codes mean."""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivers.wire.reply_text import unusable

_GENERAL_ERRORS = {
    4: "emergency stop activated",
    6: "command does not exist",
    7: "parameter out of range",
    9: "axis number out of range",
    37: "axis number missing",
    38: "command parameter missing",
    40: "last command cannot be repeated",
}
_HOMING_ABORTED = 20
_AXIS_ERRORS = {
    0: "motor type not defined",
    1: "parameter out of range",
    2: "amplifier fault",
    3: "following error threshold exceeded",
    4: "positive hardware limit detected",
    5: "negative hardware limit detected",
    6: "positive software limit detected",
    7: "negative software limit detected",
    8: "motor or stage not connected",
    9: "feedback signal fault",
    10: "maximum velocity exceeded",
    11: "maximum acceleration exceeded",
    13: "motor not enabled",
    15: "maximum jerk exceeded",
    _HOMING_ABORTED: "homing aborted",
    24: "speed out of range",
    30: "command not allowed during homing",
}
_REPORT = re.compile(r"(\d{1,4})\s*,\s*(\d+)\s*,\s*(.+)", re.ASCII)


@dataclass(frozen=True)
class ControllerError:
    """One entry of the controller's error queue; `axis` is None for an error of the controller itself."""

    code: int
    axis: int | None
    text: str

    @property
    def is_homing_aborted(self) -> bool:
        """Whether a search for home was ended before it had found it."""
        return self.axis is not None and self.code % 100 == _HOMING_ABORTED

    def __str__(self) -> str:
        return f"error {self.code}, {self.text}" + ("" if self.axis is None else f" (axis {self.axis})")


def parse_error(device: str, line: str) -> ControllerError | None:
    """Read an answer to ``TB?``: code, time stamp, message.

    Returns
    -------
    ControllerError or None
        None when the queue is empty (code 0).

    Raises
    ------
    ReplyError
        When the line has another form.
    """
    report = _REPORT.fullmatch(line.strip())
    if report is None:
        raise unusable(device, "TB?", line, "an error report (code, time stamp, message)")
    code, message = int(report[1]), report[3].lower()
    if code == 0:
        return None
    if code < 100:
        return ControllerError(code, None, _GENERAL_ERRORS.get(code, message))
    return ControllerError(code, code // 100, _AXIS_ERRORS.get(code % 100, message))
