"""Several wavelengths in a scan: all directions at one, and then at the next."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from acquisition.section import SectionFault
from acquisition.timing import FIRST_SLOT, BenchTiming, WheelTiming

if TYPE_CHECKING:
    from acquisition.readings import Reading
    from acquisition.recipe import Recipe
    from acquisition.steps import Slots, Step

Wavelength = Annotated[float, Field(ge=200, le=2500)]
Wavelengths = Wavelength | Annotated[tuple[Wavelength, ...], Field(strict=False, min_length=1)]


def wavelength_faults(recipe: Recipe) -> Iterator[SectionFault]:
    """What does not go with several wavelengths, or with how they are listed."""
    listed = recipe.wavelengths_nm()
    for wavelength_nm, times in Counter(listed).items():
        if times > 1:
            yield ("wavelength_nm",), f"{wavelength_nm:g} stands {times} times; allowed: each wavelength once"
    if len(listed) == 1:
        return
    for key, is_given in (("adaptive", recipe.adaptive), ("until", recipe.until is not None)):
        if is_given:
            yield (key,), "a fit holds for one wavelength, and here are several; write one, or leave this key out"
    if recipe.averaging is not None:
        yield (
            ("readings",),
            "got a group of keys, which is for scans at one wavelength; write a number, or a list of them",
        )
    if recipe.calibration is not None:
        yield (
            ("calibration",),
            "a calibration holds at one wavelength, and here are several; write one wavelength, or leave it out",
        )


def by_wavelength(recipe: Recipe, readings: Sequence[Reading]) -> dict[float, tuple[Reading, ...]]:
    """The readings at each wavelength of a recipe, in its order; at its only one those of old journals, too."""
    listed = recipe.wavelengths_nm()
    if len(listed) == 1:
        known = (one if one.wavelength_nm is not None else replace(one, wavelength_nm=listed[0]) for one in readings)
        return {listed[0]: tuple(known)}
    return {nm: tuple(one for one in readings if one.wavelength_nm == nm) for nm in listed}


def expand_wavelengths(recipe: Recipe, slots: Mapping[float, Slots], timing: BenchTiming) -> tuple[Step, ...]:
    """Turn a recipe into its steps, wavelength after wavelength, so that the filters turn least.

    Parameters
    ----------
    recipe : Recipe
        What to measure.
    slots : mapping of float to Slots
        What the rig's analyzer holds, by wavelength in nm, with the slot of its filter.
    timing : BenchTiming
        Speeds of the rig.

    Returns
    -------
    tuple of Step
        As `expand` has them, one wavelength behind the other. `point` counts the directions at the first wavelength of
        the recipe, then those at the second, and so on, in whatever order they are measured.
    """
    from acquisition.expand import HOME, expand

    listed, count = recipe.wavelengths_nm(), len(recipe.directions_deg())
    steps: list[Step] = []
    here = HOME
    for wavelength_nm in _in_order(listed, slots, timing.filter):
        first = listed.index(wavelength_nm) * count
        at_one = expand(recipe.at_wavelength(wavelength_nm), slots[wavelength_nm], timing, here)
        steps += [replace(step, point=first + step.point) for step in at_one]
        here = steps[-1].target
    return tuple(steps)


def _in_order(listed: Sequence[float], slots: Mapping[float, Slots], wheel: WheelTiming | None) -> Sequence[float]:
    """The wavelengths in the order, round the wheel, that takes the least time from its first slot."""
    if wheel is None:
        return listed
    slot_of = {wavelength_nm: slots[wavelength_nm].filter_slot or FIRST_SLOT for wavelength_nm in listed}

    def time_s(order: Sequence[float]) -> float:
        stops = [FIRST_SLOT, *(slot_of[wavelength_nm] for wavelength_nm in order)]
        return sum(wheel.move_s(one, other) for one, other in itertools.pairwise(stops))

    up = sorted(listed, key=lambda wavelength_nm: slot_of[wavelength_nm])
    rounds = (order[first:] + order[:first] for order in (up, up[::-1]) for first in range(len(listed)))
    return min(rounds, key=time_s)
