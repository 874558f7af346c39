"""Numbers and switches as SCPI instruments print and read them."""

from __future__ import annotations

import numpy as np

from sim_devices.thorlabs_pm100.scpi import ScpiError


def number(value: float) -> str:
    """Shortest text that reads back as the same number, in the form 1.234205E-03."""
    return np.format_float_scientific(value, trim="0", exp_digits=2).upper()


def tell(arguments: list[str], value: float, low: float, high: float) -> str:
    """Answer a query for a number: the number, or one of its limits where the argument asks for that."""
    if not arguments:
        return number(value)
    limit = _limit(arguments[0], low, high)
    if limit is None:
        raise ScpiError(-224)
    return number(limit)


def parse(argument: str, low: float, high: float) -> float:
    """Read a number between two limits, or the name of one of them."""
    limit = _limit(argument, low, high)
    if limit is not None:
        return limit
    try:
        value = float(argument)
    except ValueError:
        raise ScpiError(-104) from None
    if not low <= value <= high:
        raise ScpiError(-222)
    return value


def parse_switch(argument: str) -> int:
    """Read 0, 1, OFF or ON."""
    states = {"0": 0, "OFF": 0, "1": 1, "ON": 1}
    if argument.upper() not in states:
        raise ScpiError(-224)
    return states[argument.upper()]


def _limit(argument: str, low: float, high: float) -> float | None:
    match argument.upper():
        case "MIN" | "MINIMUM":
            return low
        case "MAX" | "MAXIMUM":
            return high
        case _:
            return None
