"""Formulas as graphs: a function of `Symbol`s, called once, leaves the graph of what it computes.

Formulas are ordinary Python functions. On numbers and arrays they compute; on symbols they record. The graph is what
the compiler and the derivative work on: it holds every expression once, has no zeros added nor ones multiplied, and of
what is asked of it nothing but the way there is computed. A loop in a formula is unrolled, a branch in it is taken at
once, so that an effect which a surface does not have leaves no trace.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Union

import numpy as np

# What formulas are made of; truths are values too. Arrays serve as numbers, though types do not say so.
Value = Union["Symbol", float]

_NUMPY: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "exp": np.exp,
    "atan2": np.arctan2,
    "min": np.minimum,
    "max": np.maximum,
    "lt": np.less,
    "le": np.less_equal,
    "and": np.logical_and,
    "or": np.logical_or,
    "where": np.where,
    "damped": lambda factor, x: np.exp(x) * (factor * np.exp(x)),
    "guarded": lambda mask, value: np.where(mask, value, 0.0),
}


class Graph:
    """Expressions over a kernel's inputs, every one of them held once."""

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], Symbol] = {}

    def input(self, name: str) -> Symbol:
        """The symbol of an input."""
        return self.symbol("input", (), name)

    def constant(self, value: float) -> Symbol:
        """The symbol of a number, or of a truth."""
        # 0.0 and -0.0 are equal as keys of a dictionary, but not in a quotient.
        return self.symbol("constant", (), value, math.copysign(1.0, value))

    def symbol(self, operation: str, arguments: tuple[Symbol, ...], *detail: object) -> Symbol:
        """The symbol of an operation on others, made if it is not there yet."""
        key = (operation, *(argument.serial for argument in arguments), *detail)
        known = self._known.get(key)
        if known is None:
            value = detail[0] if detail else None
            known = self._known[key] = Symbol(self, len(self._known), operation, arguments, value)
        return known


class Symbol:
    """One expression; arithmetic with it makes further ones. Comparisons make truths, which `where` takes."""

    __slots__ = ("arguments", "detail", "graph", "operation", "serial")

    def __init__(self, graph: Graph, serial: int, operation: str, arguments: tuple[Symbol, ...], detail: Any) -> None:
        self.graph = graph
        self.serial = serial
        self.operation = operation
        self.arguments = arguments
        self.detail = detail

    @property
    def number(self) -> float | None:
        """The number that the symbol stands for, if it is a constant."""
        return self.detail if self.operation == "constant" else None

    def __bool__(self) -> bool:
        raise TypeError("A symbol is neither true nor false: use where(), or decide before the formula is recorded.")

    def __add__(self, other: Value) -> Value:
        return apply("add", self, other)

    def __radd__(self, other: Value) -> Value:
        return apply("add", other, self)

    def __sub__(self, other: Value) -> Value:
        return apply("sub", self, other)

    def __rsub__(self, other: Value) -> Value:
        return apply("sub", other, self)

    def __mul__(self, other: Value) -> Value:
        return apply("mul", self, other)

    def __rmul__(self, other: Value) -> Value:
        return apply("mul", other, self)

    def __truediv__(self, other: Value) -> Value:
        return apply("div", self, other)

    def __rtruediv__(self, other: Value) -> Value:
        return apply("div", other, self)

    def __neg__(self) -> Value:
        return apply("neg", self)

    def __abs__(self) -> Value:
        return apply("abs", self)

    def __lt__(self, other: Value) -> Value:
        return apply("lt", self, other)

    def __le__(self, other: Value) -> Value:
        return apply("le", self, other)

    def __gt__(self, other: Value) -> Value:
        return apply("lt", other, self)

    def __ge__(self, other: Value) -> Value:
        return apply("le", other, self)


def apply(operation: str, *values: Value) -> Value:
    """The result of an operation: computed if all values are numbers or arrays, otherwise a symbol, simplified."""
    graph = next((value.graph for value in values if isinstance(value, Symbol)), None)
    numbers = [value.number if isinstance(value, Symbol) else value for value in values]
    if operation in _NUMPY and not any(number is None for number in numbers):
        return _NUMPY[operation](*numbers)  # type: ignore[no-any-return]
    assert graph is not None, "only symbols have operations that numbers have not"
    simpler = _simplified(operation, values, numbers)
    if simpler is not None:
        return simpler
    arguments = tuple(value if isinstance(value, Symbol) else graph.constant(value) for value in values)
    if operation in ("add", "mul", "min", "max"):
        arguments = tuple(sorted(arguments, key=lambda argument: argument.serial))
    return graph.symbol(operation, arguments)


def sqrt(x: Value) -> Value:
    """Square root."""
    return apply("sqrt", x)


def sin(x: Value) -> Value:
    """Sine."""
    return apply("sin", x)


def cos(x: Value) -> Value:
    """Cosine."""
    return apply("cos", x)


def exp(x: Value) -> Value:
    """Exponential function of what is not above 0."""
    return apply("exp", x)


def damped(factor: Value, x: Value) -> Value:
    """The product factor · exp(2 x), x not above 0; 0 where nothing but an underflow is left of the exponential.

    The exponential is taken by halves: a large factor must not meet one that has lost its digits.
    """
    return apply("damped", factor, x)


def atan2(y: Value, x: Value) -> Value:
    """Angle of the point (x, y), x >= 0."""
    return apply("atan2", y, x)


def minimum(first: Value, *others: Value) -> Value:
    """The smallest."""
    for other in others:
        first = apply("min", first, other)
    return first


def maximum(first: Value, *others: Value) -> Value:
    """The largest."""
    for other in others:
        first = apply("max", first, other)
    return first


def hypot(x: Value, y: Value) -> Value:
    """Length of (x, y), also where its square would overflow or underflow."""
    larger, smaller = maximum(abs(x), abs(y)), minimum(abs(x), abs(y))
    ratio = smaller / where(larger > 0.0, larger, 1.0)
    return larger * sqrt(1.0 + ratio * ratio)


def both(first: Value, *others: Value) -> Value:
    """Whether all of these hold."""
    for other in others:
        first = apply("and", first, other)
    return first


def either(first: Value, *others: Value) -> Value:
    """Whether any of these holds."""
    for other in others:
        first = apply("or", first, other)
    return first


def where(mask: Value, then: Value, otherwise: Value) -> Value:
    """One value where a truth holds, another elsewhere; both are computed."""
    return apply("where", mask, then, otherwise)


def guarded(mask: Value, value: Value) -> Value:
    """A value where a truth holds, 0 elsewhere; not computed where it holds for no direction of several at once."""
    return apply("guarded", mask, value)


def fma(a: Value, b: Value, c: Value) -> Value:
    """Product and sum a b + c, rounded once."""
    return apply("fma", a, b, c)


def nearest(x: Value) -> Value:
    """Nearest whole number, of even ones in doubt, below 2**22."""
    return apply("nearest", x)


def odd(n: Value) -> Value:
    """Whether a whole number is odd."""
    return apply("odd", n)


def second_bit(n: Value) -> Value:
    """Whether a whole number leaves 2 or 3 when divided by 4."""
    return apply("second_bit", n)


def power_of_two(n: Value) -> Value:
    """2 to the power of a whole number, where that is a normal number."""
    return apply("power_of_two", n)


def reachable(outputs: Sequence[Symbol]) -> list[Symbol]:
    """All that the outputs are made of, every symbol after its arguments."""
    seen: dict[int, Symbol] = {}
    stack = list(outputs)
    while stack:
        symbol = stack.pop()
        if symbol.serial not in seen:
            seen[symbol.serial] = symbol
            stack.extend(symbol.arguments)
    return [seen[serial] for serial in sorted(seen)]


def _simplified(operation: str, values: tuple[Value, ...], numbers: list[Any]) -> Value | None:
    match operation:
        case "add" if 0.0 in numbers:
            return values[1 - numbers.index(0.0)]
        case "sub" if numbers[1] == 0.0:
            return values[0]
        case "sub" if numbers[0] == 0.0:
            return -values[1]
        case "mul" if 0.0 in numbers:
            return 0.0
        case "mul" if 1.0 in numbers:
            return values[1 - numbers.index(1.0)]
        case "mul" if -1.0 in numbers:
            return -values[1 - numbers.index(-1.0)]
        case "div" if numbers[0] == 0.0:
            return 0.0
        case "div" if numbers[1] == 1.0:
            return values[0]
        case "neg" if isinstance(values[0], Symbol) and values[0].operation == "neg":
            return values[0].arguments[0]
        case "where" if numbers[0] is not None:
            return values[1] if numbers[0] else values[2]
        case "where" if values[1] is values[2] or (numbers[1] is not None and numbers[1] == numbers[2]):
            return values[1]
        case "guarded" if numbers[0] is not None:
            return values[1] if numbers[0] else 0.0
        case "guarded" if numbers[1] == 0.0:
            return 0.0
    return None
