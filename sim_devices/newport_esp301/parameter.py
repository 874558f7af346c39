"""What follows an ESP301's commands, and the errors of what should not."""

from __future__ import annotations

import re

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(E[+-]?\d{1,2})?")
_LARGEST = 1e9


class Esp301Error(Exception):
    """A command that is refused; `code` counts from the axis' hundred when `of_axis`."""

    def __init__(self, code: int, *, of_axis: bool = False) -> None:
        super().__init__(code)
        self.code, self.of_axis = code, of_axis


def axis_error(code: int) -> Esp301Error:
    """An error that counts from the axis' hundred."""
    return Esp301Error(code, of_axis=True)


def to_number(parameter: str) -> float:
    """Read a command's parameter; error 38 when there is none, 7 when it is not a number, or too large."""
    if not parameter:
        raise Esp301Error(38)
    if not _NUMBER.fullmatch(parameter) or abs(float(parameter)) > _LARGEST:
        raise Esp301Error(7)
    return float(parameter)


def to_choice(parameter: str, allowed: range) -> int:
    """Read a parameter that is one of some whole numbers; error 7 when it is another."""
    value = to_number(parameter)
    if value not in allowed:
        raise Esp301Error(7)
    return int(value)


def require_query(parameter: str) -> None:
    """Refuse all but a question mark: error 38 when there is nothing, 7 when there is something else."""
    if parameter != "?":
        raise Esp301Error(7 if parameter else 38)
