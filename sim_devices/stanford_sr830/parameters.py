"""What follows an SR830's commands, and how it prints numbers."""

from __future__ import annotations

import re

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(E[+-]?\d{1,2})?", re.ASCII)


class BadParameterError(Exception):
    """A command that is refused for its parameters."""


def require(condition: bool) -> None:
    """Refuse the command unless a condition holds."""
    if not condition:
        raise BadParameterError


def numbers(text: str) -> list[float]:
    """Read parameters, separated by commas."""
    parts = text.split(",") if text else []
    require(all(_NUMBER.fullmatch(part) for part in parts))
    return [float(part) for part in parts]


def place(parameters: list[float], count: int) -> int:
    """The one parameter, a number from 1 to `count`, as a place from 0."""
    require(len(parameters) == 1 and parameters[0] in range(1, count + 1))
    return int(parameters[0]) - 1


def text(value: float) -> str:
    """Six significant digits, such as 0.000202046 or -3.59302e-07."""
    return f"{value + 0.0:g}"


def told(byte: int, parameters: list[float]) -> tuple[str, int]:
    """A status byte as it is told, or the one bit of it that is asked for, and what of it is left."""
    if not parameters:
        return text(byte), 0
    require(len(parameters) == 1 and parameters[0] in range(8))
    bit = 1 << int(parameters[0])
    return str(int(bool(byte & bit))), byte & ~bit
