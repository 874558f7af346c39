"""What is wrong with a family of surfaces: unknown names, names that stand twice, values out of order or of range."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from model.bounce_bound import Tolerance
from model.fit.quantities import INSTRUMENT, kind_of, quantity
from model.lobes import Specular

if TYPE_CHECKING:
    from model.fit.family import SurfaceFamily


def family_faults(family: SurfaceFamily) -> Iterator[str]:
    """Say what is wrong with a family, one sentence each; nothing if nothing is."""
    yield from _name_faults(family)
    yield from _value_faults(family)


def _name_faults(family: SurfaceFamily) -> Iterator[str]:
    own = [f"{kind_of(lobe)}.{name}" for lobe in family.lobes for name in lobe.values]
    known = [*family.surface.parameters, *own, *INSTRUMENT]
    groups = {"free": family.free, "fixed": family.fixed, "tied": family.tied}
    for group, names in groups.items():
        for name in names:
            if name not in known:
                yield f"{group} names '{name}'; this surface and its instrument have {sorted(set(known))}"
    for name in dict.fromkeys([*family.free, *family.fixed, *family.tied]):
        found = [group for group, names in groups.items() if name in names]
        if len(found) > 1:
            yield f"{name} stands in {' and in '.join(found)}; it must stand in one of them"
    for name, (other, _) in family.tied.items():
        if other not in family.free:
            yield f"{name} is tied to {other}, which is not free"
        if name in INSTRUMENT or other in INSTRUMENT:
            yield f"{name} is tied to {other}; only parameters of the surface can be tied"
    for name in family.prior:
        if name not in family.free:
            yield f"a prior is given for {name}, which is not free"
    if any(isinstance(lobe, Specular) and isinstance(lobe.bounces, Tolerance) for lobe in family.lobes):
        yield "the specular lobe follows bounces to a tolerance; a fit needs a number of bounces"


def _value_faults(family: SurfaceFamily) -> Iterator[str]:
    for name, (low, high) in family.free.items():
        if not low < high:
            yield f"free bounds of {name} are [{low:g}, {high:g}]; they must increase"
        elif not (_is_possible(name, low) and _is_possible(name, high)):
            yield f"free bounds of {name} are [{low:g}, {high:g}]; {_allowed(name)}"
    for name, value in family.fixed.items():
        if not _is_possible(name, value):
            yield f"fixed {name} is {value:g}; {_allowed(name)}"
    for name, (mean, stddev) in family.prior.items():
        if not (math.isfinite(mean) and 0.0 < stddev < math.inf):
            yield f"the prior of {name} is {mean:g} ± {stddev:g}; it needs a finite mean and a deviation above 0"
    for name, (other, factor) in family.tied.items():
        if not 0.0 < factor < math.inf:
            yield f"the factor of {name} is {factor:g}; it must be above 0"
        elif not all(_is_possible(name, factor * bound) for bound in family.free.get(other, ())):
            yield f"{name} is {factor:g} times {other}, which leaves its range; {_allowed(name)}"


def _is_possible(name: str, value: float) -> bool:
    kind = quantity(name)
    return kind.lowest <= value <= kind.highest


def _allowed(name: str) -> str:
    kind = quantity(name)
    return f"the {kind.meaning} lies from {kind.lowest:g} to {kind.highest:g}"
