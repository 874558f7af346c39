"""What a PM100 says has gone wrong, and what a person is told of it."""

from __future__ import annotations

import re

from drivers.wire.reply_text import unusable
from goniometer.errors import DeviceFaultError, ReplyTimeoutError

_ERROR = re.compile(r"([+-]?\d{1,9})\s*,\s*\"?([^\"]*)\"?", re.ASCII)


def parse_error(device: str, line: str) -> tuple[int, str]:
    """Read an answer to ``SYST:ERR?`` such as ``-113,"Undefined header"``: code (0 for none) and text."""
    report = _ERROR.fullmatch(line)
    if report is None:
        raise unusable(device, "SYST:ERR?", line, "an error code and its text")
    return int(report[1]), report[2]


def saturated(device: str, answer: float) -> DeviceFaultError:
    """Describe an answer that stands for too much light."""
    return DeviceFaultError(
        device,
        f"the detector was saturated (the meter answered {answer:g})",
        not_done="the reading was thrown away",
        to_do="weaken the beam, or use a sensor for more power",
    )


def settings_lost(device: str, question: str, held: float, expected: str) -> DeviceFaultError:
    """Describe a meter that is not set as it was told."""
    return DeviceFaultError(
        device,
        f"it answers {question!r} with {held:g}, which is not {expected} that it was told: it refuses that, or it has "
        "been switched off and on, or somebody has changed its settings",
        not_done="no reading was taken with other settings",
        to_do="check its power and its plug, leave its settings alone, and start again",
    )


def overdue(device: str, port: str, exposure_s: float) -> ReplyTimeoutError:
    """Describe a reading that does not come."""
    return ReplyTimeoutError(
        device,
        f"no reading on port {port} 2 s after twice its exposure of {exposure_s:g} s",
        not_done="the reading was given up",
        to_do="check that the meter is on, that its cable sits, and that sample_s in the rig file is right",
    )
