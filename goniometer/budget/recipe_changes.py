"""What a person could change about a recipe to know more: readings, exposure, angles, range, polarizers."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.analyzer_matrix import check_analyzer_set
from acquisition.recipe import MAX_READINGS, WIDEST_EXIT_DEG, Recipe
from goniometer.errors import ReductionError
from goniometer.rig_file import Rig

_TIMES = 4
_WIDER = 0.25


@dataclass(frozen=True)
class Change:
    """A recipe that differs in one thing, and in what."""

    words: str
    recipe: Recipe


def changes(recipe: Recipe, rig: Rig) -> Iterator[Change]:
    """Changes of a recipe that its rig allows, other sets of polarizers left out."""
    yield from _more_readings(recipe)
    longer_s = _TIMES * recipe.exposure_s
    if longer_s <= rig.detector.most_samples * rig.detector.sample_s:
        yield Change(f"exposure {longer_s:g} s", recipe.model_copy(update={"exposure_s": longer_s}))
    angles_deg = recipe.exit_angles_deg()
    if len(angles_deg) > 1:  # a list of points has none
        yield Change("angles half as far apart", _with_angles(recipe, _finer(angles_deg)))
        yield from _wider(recipe, rig)


def polarizer_sets(recipe: Recipe, rig: Rig) -> tuple[list[Change], list[Change]]:
    """The recipe with every polarizer of the rig's wheel, and with any three of them, unless it is so already."""
    offered = sorted(content for content in rig.analyzer.contents().values() if not isinstance(content, str))
    every = [Change(_named(offered), _with_polarizers(recipe, offered))] if len(offered) > 3 else []
    triples = [
        Change(_named(three), _with_polarizers(recipe, three))
        for three in itertools.combinations(offered, 3)
        if _is_sufficient(three)
    ]

    def is_new(change: Change) -> bool:
        return set(change.recipe.analyzer_deg) != set(recipe.analyzer_deg)

    return list(filter(is_new, every)), list(filter(is_new, triples))


def _more_readings(recipe: Recipe) -> Iterator[Change]:
    each = recipe.readings_of_angles()
    if _TIMES * max(each) <= MAX_READINGS:
        several = isinstance(recipe.readings, tuple)
        readings = tuple(_TIMES * count for count in each) if several else _TIMES * each[0]
        words = f"{_TIMES} times the readings" if several else f"{readings} readings in every slot"
        yield Change(words, recipe.model_copy(update={"readings": readings}))


def _finer(angles_deg: Sequence[float]) -> list[float]:
    middles = [(one + other) / 2.0 for one, other in itertools.pairwise(angles_deg)]
    return [angle for pair in zip(angles_deg[:-1], middles, strict=True) for angle in pair] + [angles_deg[-1]]


def _wider(recipe: Recipe, rig: Rig) -> Iterator[Change]:
    """The range with a quarter of it added at its end, and at its beginning, in steps as they are there."""
    low_deg, high_deg = rig.axes()["detector_arm"].limits_deg
    low_deg, high_deg = max(low_deg, -WIDEST_EXIT_DEG), min(high_deg, WIDEST_EXIT_DEG)
    onward = recipe.exit_angles_deg()
    for angles_deg in (onward, onward[::-1]):
        step_deg = angles_deg[-1] - angles_deg[-2]
        most = int(_WIDER * abs((angles_deg[-1] - angles_deg[0]) / step_deg) + 1e-9)
        beyond = [angles_deg[-1] + step_deg * (number + 1) for number in range(most)]
        beyond = [angle for angle in beyond if low_deg <= angle <= high_deg]
        if beyond:
            wider = [*angles_deg, *beyond]
            ordered = wider if angles_deg is onward else wider[::-1]
            yield Change(f"exit angles to {beyond[-1]:g}°", _with_angles(recipe, ordered))


def _with_angles(recipe: Recipe, angles_deg: Sequence[float]) -> Recipe:
    """Other exit angles, each with the readings of the nearest there was."""
    before_deg, each = np.array(recipe.exit_angles_deg()), recipe.readings_of_angles()
    readings = tuple(each[int(np.argmin(np.abs(before_deg - angle)))] for angle in angles_deg)
    is_list = isinstance(recipe.readings, tuple)
    update = {"exit": None, "exit_deg": tuple(angles_deg), "readings": readings if is_list else recipe.readings}
    return recipe.model_copy(update=update)


def _with_polarizers(recipe: Recipe, angles_deg: Sequence[float]) -> Recipe:
    return recipe.model_copy(update={"analyzer_deg": tuple(angles_deg)})


def _named(angles_deg: Sequence[float]) -> str:
    return f"polarizers {', '.join(f'{angle:g}' for angle in angles_deg)}"


def _is_sufficient(angles_deg: Sequence[float]) -> bool:
    try:
        check_analyzer_set(angles_deg)
    except ReductionError:
        return False
    return True
