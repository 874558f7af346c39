"""From the operations of formulas to those of a processor: transcendental functions become polynomials."""

from __future__ import annotations

from collections.abc import Sequence

from model.kernel.elementary import Precision, arctangent2, damped_exponential, exponential, sine_cosine
from model.kernel.expression import Symbol, Value, apply, reachable


def lowered(outputs: Sequence[Value], precision: Precision) -> list[Value]:
    """The same expressions without sine, cosine, exponential and arctangent.

    Parameters
    ----------
    outputs : sequence of Value
        Expressions of one graph.
    precision : Precision
        What the polynomials have to reach.
    """
    lower: dict[int, Value] = {}
    for symbol in reachable([output for output in outputs if isinstance(output, Symbol)]):
        lower[symbol.serial] = _lower(symbol, [lower[argument.serial] for argument in symbol.arguments], precision)
    return [lower[output.serial] if isinstance(output, Symbol) else output for output in outputs]


def _lower(symbol: Symbol, arguments: Sequence[Value], precision: Precision) -> Value:
    match symbol.operation:
        case "input" | "constant":
            return symbol
        case "sin":
            return sine_cosine(arguments[0], precision)[0]
        case "cos":
            return sine_cosine(arguments[0], precision)[1]
        case "exp":
            return exponential(arguments[0], precision)
        case "damped":
            return damped_exponential(arguments[0], arguments[1], precision)
        case "atan2":
            return arctangent2(arguments[0], arguments[1], precision)
        case operation:
            return apply(operation, *arguments)
