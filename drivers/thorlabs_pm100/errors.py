"""What a PM100 says has gone wrong, and what a person is told of it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from drivers.wire.reply_text import unusable
from goniometer.errors import DeviceFaultError, ReplyTimeoutError, SaturatedError

_ERROR = re.compile(r"([+-]?\d{1,9})\s*,\s*\"?([^\"]*)\"?", re.ASCII)


def parse_error(device: str, line: str) -> tuple[int, str]:
    """Read an answer to ``SYST:ERR?`` such as ``-113,"Undefined header"``: code (0 for none) and text."""
    report = _ERROR.fullmatch(line)
    if report is None:
        raise unusable(device, "SYST:ERR?", line, "an error code and its text")
    return int(report[1]), report[2]


def set_up_refused(device: str, refused: Sequence[str]) -> DeviceFaultError:
    """Describe a meter that refuses what every meter with a power sensor takes."""
    return DeviceFaultError(
        device,
        f"the meter refused watts and automatic range: {'; '.join(refused)}",
        not_done="the meter was not set up",
        to_do="check that a power sensor is plugged in",
    )


def saturated(device: str, answer: float) -> SaturatedError:
    """Describe an answer that stands for too much light."""
    return SaturatedError(
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


def other_attenuation(device: str, held_db: float, expected_db: float) -> DeviceFaultError:
    """Describe a meter that corrects its readings for another attenuator than the rig file names."""
    return DeviceFaultError(
        device,
        f"it corrects its readings for an attenuator of {held_db:g} dB before its sensor, and the rig file says "
        f"{expected_db:g} dB: every power would be wrong by a factor of {10 ** ((held_db - expected_db) / 10):.4g}",
        not_done="no reading was taken, and the meter keeps its correction",
        to_do=f"if the attenuator is in the beam, write attenuation_db: {held_db:g} for the meter into the rig file; "
        f"if not, set the attenuation at the meter to {expected_db:g} dB",
    )


def overdue(device: str, port: str, exposure_s: float) -> ReplyTimeoutError:
    """Describe a reading that does not come."""
    return ReplyTimeoutError(
        device,
        f"no reading on port {port} 2 s after twice its exposure of {exposure_s:g} s",
        not_done="the reading was given up",
        to_do="check that the meter is on, that its cable sits, and that sample_s in the rig file is right",
    )
