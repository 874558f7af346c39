"""How a number and its standard error are written: the error with two digits, the number as far as it is known."""

from __future__ import annotations

import math

_FIXED_EXPONENTS = range(-4, 6)
"""Powers of ten of the larger of number and error that are written without an exponent."""
_MOST_DECIMALS = 7
_UNKNOWN_ERROR_DIGITS = 4


def plus_minus(value: float, stderr: float | None) -> str:
    """Write ``2.950 ± 0.012``; only the number when its error is not known.

    Parameters
    ----------
    value : float
        The number.
    stderr : float or None
        Its standard error, >= 0.
    """
    number, error = number_and_error(value, stderr)
    return f"{number} ± {error}" if error else number


def number_and_error(value: float, stderr: float | None) -> tuple[str, str]:
    """Write a number and its standard error as two texts, for the columns of a table.

    Parameters
    ----------
    value : float
        The number.
    stderr : float or None
        Its standard error, >= 0; None, NaN or infinite when it is not known.

    Returns
    -------
    tuple of str
        The number, rounded to the second digit of the error, and the error; the error is empty when it is not known.
    """
    if not math.isfinite(value) or stderr is None or not math.isfinite(stderr):
        return f"{value:.{_UNKNOWN_ERROR_DIGITS}g}", ""
    if stderr == 0.0:
        return f"{value:.{_MOST_DECIMALS}g}", "0"
    scale = _exponent(max(abs(value), stderr))
    exponent = 0 if scale in _FIXED_EXPONENTS else scale
    power = f"e{exponent:+03d}" if exponent else ""
    unit, decimals = 10.0**exponent, exponent + 1 - _exponent(stderr)
    if decimals > _MOST_DECIMALS:
        return f"{value / unit:z.{_MOST_DECIMALS}f}{power}", f"{stderr:.1e}"
    number, error = (f"{round(part / unit, decimals):z.{max(decimals, 0)}f}{power}" for part in (value, stderr))
    return number, error


def _exponent(number: float) -> int:
    """The power of ten of the first of two digits, after rounding to two."""
    return int(f"{number:.1e}".partition("e")[2])
