"""Which inputs of a compiled surface follow from which free parameters of a family, and how fast."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from model.evaluation import Addend
from model.fit.family import SurfaceFamily
from model.fit.quantities import kind_of
from model.geometry import FloatArray
from model.lobes import Lobe
from model.surface import Surface, rate_input

Numbers = dict[str, FloatArray | float]
Rates = dict[tuple[str, str], FloatArray | float]


@dataclass(frozen=True)
class _Wired:
    """One lobe: where its parameters come from, and which inputs its numbers go to.

    `followed` holds, of those of its parameters that are not fixed, the free parameter that each follows and the
    factor between the two; `held` the values of the others.
    """

    lobe: Lobe
    followed: dict[str, tuple[str, float]]
    held: dict[str, float]
    wires: dict[str, str]

    def values(self, free: Mapping[str, FloatArray]) -> dict[str, FloatArray | float]:
        """All parameters of the lobe, where the free ones have these values."""
        values: Numbers = dict(self.held)
        for name, (source, factor) in self.followed.items():
            values[name] = free[source] if factor == 1.0 else factor * free[source]
        return values


class Wiring:
    """The inputs of some lobes of a family, and how they change with its free parameters.

    Lobes that share a parameter take it from one input, and share what follows from it.

    Parameters
    ----------
    family : SurfaceFamily
        What is free.
    places : sequence of int
        Which of the family's lobes.
    """

    def __init__(self, family: SurfaceFamily, places: Sequence[int]) -> None:
        self._places = places
        self._lobes = [_wired(family, place) for place in places]

    def addends(self, example: Surface) -> Iterator[Addend]:
        """The addends of a program of these lobes, of which the example is one."""
        for place, wired in zip(self._places, self._lobes, strict=True):
            yield Addend(example.lobes[place].form(frozenset(wired.followed)), tuple(wired.wires.items()))

    def inputs(self, values: Mapping[str, FloatArray]) -> tuple[Numbers, Rates]:
        """What the program takes, and how fast each of it changes with each free parameter."""
        numbers: Numbers = {}
        rates: Rates = {}
        for wired in self._lobes:
            own = wired.values(values)
            for name, number in wired.lobe.numbers_of(own).items():  # type: ignore[arg-type]
                numbers[wired.wires[name]] = number
            for parameter, (free, factor) in wired.followed.items():
                for name, rate in wired.lobe.rates(parameter, own).items():  # type: ignore[arg-type]
                    rates[wired.wires[name], free] = rate if factor == 1.0 else factor * rate
        return numbers, rates


def named(rates: Rates) -> Numbers:
    """The rates that are inputs of a program, by their names."""
    return {
        name: rate
        for (source, parameter), rate in rates.items()
        if isinstance(name := rate_input(source, parameter, rate), str)
    }


def _wired(family: SurfaceFamily, place: int) -> _Wired:
    lobe = family.lobes[place]
    followed: dict[str, tuple[str, float]] = {}
    held: dict[str, float] = {}
    sources = {}
    for name, own in lobe.values.items():
        key = family.key(lobe, name)
        if key in family.free:
            followed[name], sources[name] = (key, 1.0), key
        elif key in family.tied:
            followed[name], sources[name] = family.tied[key], key
        else:
            held[name] = family.fixed.get(key, own)
            sources[name] = f"{name} = {held[name]!r}"
    wires = {name: sources.get(name, f"{kind_of(lobe)} {place}: {name}") for name in lobe.numbers}
    return _Wired(lobe, followed, held, wires)
