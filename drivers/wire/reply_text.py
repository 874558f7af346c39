"""Values in answers that are text: read strictly, so that garbage is never taken for a value."""

from __future__ import annotations

import re

from goniometer.errors import ReplyError

_MOST_SHOWN = 80
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def number(device: str, question: str, answer: str) -> float:
    """Read a finite decimal number such as ``12.500000`` or ``1.234205E-03``; raises ReplyError otherwise."""
    if not _NUMBER.fullmatch(answer) or abs(float(answer)) == float("inf"):
        raise unusable(device, question, answer, "a number")
    return float(answer)


def whole_number(device: str, question: str, answer: str) -> int:
    """Read an integer such as ``3`` or ``+0``; raises ReplyError otherwise."""
    if not re.fullmatch(r"[+-]?[0-9]{1,9}", answer):
        raise unusable(device, question, answer, "a whole number")
    return int(answer)


def switch(device: str, question: str, answer: str) -> bool:
    """Read ``0`` or ``1``; raises ReplyError otherwise."""
    if answer not in ("0", "1"):
        raise unusable(device, question, answer, "0 or 1")
    return answer == "1"


def unusable(device: str, question: str, answer: str, expected: str) -> ReplyError:
    """Describe an answer that cannot be the answer to `question`; of a long one, how it begins."""
    if len(answer) > _MOST_SHOWN:
        answer = f"{answer[:_MOST_SHOWN]}…"
    return ReplyError(
        device,
        f"the answer to {question!r} is {answer!r}, which is not {expected}",
        not_done="the answer was not used",
        to_do="check that the port in the rig file belongs to this device and that the baud rates agree; if it happens "
        "now and then, look for a loose cable",
    )
