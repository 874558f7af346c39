"""Derivatives of recorded formulas, exact to rounding: the chain rule, applied forwards to every expression."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from model.kernel.expression import Symbol, Value, cos, damped, guarded, hypot, maximum, reachable, sin, where

# Below this a square root's slope is taken as that of a straight line: it only ever multiplies a zero.
_SMALLEST_ROOT = 1e-30


def derivatives(outputs: Sequence[Value], seeds: Mapping[str, Value]) -> list[Value]:
    """Derivatives of expressions in one direction.

    Where two branches of a formula meet, the derivative is that of the branch whose value is taken.

    Parameters
    ----------
    outputs : sequence of Value
        What to differentiate.
    seeds : mapping of str to Value
        How fast each input changes; others stay.

    Raises
    ------
    KeyError
        If an expression holds an operation without a rule.
    """
    symbols = [output for output in outputs if isinstance(output, Symbol)]
    slope: dict[int, Value] = {}
    for symbol in reachable(symbols):
        if symbol.operation == "input":
            slope[symbol.serial] = seeds.get(str(symbol.detail), 0.0)
        elif symbol.operation in ("constant", "lt", "le", "and", "or"):
            slope[symbol.serial] = 0.0
        else:
            changes = [slope[argument.serial] for argument in symbol.arguments]
            still = all(isinstance(change, float) and change == 0.0 for change in changes)
            slope[symbol.serial] = 0.0 if still else _rule(symbol, changes)
    return [slope[output.serial] if isinstance(output, Symbol) else 0.0 for output in outputs]


def _rule(symbol: Symbol, changes: Sequence[Value]) -> Value:
    x, dx = symbol.arguments[0], changes[0]
    y, dy = (symbol.arguments[1], changes[1]) if len(changes) > 1 else (x, dx)
    match symbol.operation:
        case "add":
            return dx + dy
        case "sub":
            return dx - dy
        case "mul":
            return dx * y + x * dy
        case "div":
            return (dx - symbol * dy) / y
        case "neg":
            return -dx
        case "abs":
            return where(x < 0.0, -dx, dx)
        case "sqrt":
            return dx / (2.0 * maximum(symbol, _SMALLEST_ROOT))
        case "sin":
            return cos(x) * dx
        case "cos":
            return -sin(x) * dx
        case "exp":
            return symbol * dx
        case "damped":
            return damped(dx, y) + 2.0 * symbol * dy
        case "atan2":
            length = hypot(x, y)  # of the point (y, x): the first argument is its height
            return (y / length) * (dx / length) - (x / length) * (dy / length)
        case "min":
            return where(x < y, dx, dy)
        case "max":
            return where(x < y, dy, dx)
        case "where":
            # Where a value is infinite nothing can be said of its slope.
            infinite = y.number is not None and math.isinf(y.number)
            return where(x, math.nan if infinite else dy, changes[2])
        case "guarded":
            return guarded(x, dy)
    raise KeyError(f"{symbol.operation} has no derivative")
