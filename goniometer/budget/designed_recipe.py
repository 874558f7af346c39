"""From a recipe to one whose exit angles and readings make the most of a bench time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from acquisition.fit_points import surface_family
from acquisition.recipe import MAX_READINGS, Recipe
from goniometer.budget.assumed_sample import AssumedSample, shown
from goniometer.budget.forecast import told_by_points
from goniometer.budget.text import undetermined_text
from goniometer.errors import ConfigurationError, FitError
from goniometer.planning import plan, timing
from goniometer.rig_file import Rig
from model.design.design import Criterion
from model.design.information import prior_information, standard_errors
from model.design.timed_design import timed_design
from model.geometry import FloatArray

STEP_DEG = 0.5
"""Distance of the exit angles that a design chooses from."""

_ALIKE = 0.1
"""How much all parameters count beside the wanted one, so that a fit can tell them all."""


def designed_recipe(recipe: Recipe, rig: Rig, sample: AssumedSample, wanted: str | None, time_s: float) -> Recipe:
    """The same recipe with those exit angles of its range, and so many readings at each, that tell most in a time.

    Parameters
    ----------
    recipe, rig
        What is measured, and with what.
    sample : AssumedSample
        What is expected; where it is uncertain, the design is the best on the average of `sample.samples()`.
    wanted : str or None
        The parameter to be known best (c-optimal); None for all alike (D-optimal).
    time_s : float
        Bench time that the recipe may take.

    Raises
    ------
    ConfigurationError
        When there is no such design.
    """
    if recipe.adaptive:
        raise ConfigurationError(["An adaptive recipe chooses its exit angles as it goes. No design was made."])
    if not recipe.is_one_plane:
        what = "a list of points" if recipe.has_points else recipe.several_planes
        raise ConfigurationError(
            [f"The recipe has {what}; a design chooses exit angles in one plane. No design was made."]
        )
    if recipe.repeats > 1:
        raise ConfigurationError(["A design says how often to read each direction. Leave repeats out of the recipe."])
    family = surface_family(recipe.fit, rig.calibration.acceptance_sr)
    names = tuple(map(shown, family.names))
    angles_deg = _candidates_deg(recipe)
    # An even lamp: what references tell of it does not depend on where the detector looks.
    single = _measuring(recipe.model_copy(update={"reference": None}), angles_deg, 1)
    pieces = np.array([told_by_points(single, rig, values, sample.dark_w) for values in sample.samples()])
    prior = prior_information(family)
    stderrs = standard_errors(pieces[0].sum(axis=0) + prior)
    if np.isinf(stderrs).any():
        undetermined = [name for name, stderr in zip(names, stderrs, strict=True) if np.isinf(stderr)]
        raise ConfigurationError([f"{undetermined_text(undetermined)} No design was made."])
    criterion = Criterion() if wanted is None else Criterion(np.eye(len(names))[names.index(wanted)], _ALIKE)
    sweeps = _Sweeps(recipe, rig, angles_deg)
    try:
        readings = timed_design(pieces, criterion, sweeps.cost, time_s, MAX_READINGS, prior)
    except FitError as error:
        raise ConfigurationError([f"No design was made: {error}"]) from error
    readings_at = {angles_deg[place]: int(readings[place]) for place in np.flatnonzero(readings).tolist()}
    order_deg = sweeps.quicker(np.flatnonzero(readings).tolist()).exit_angles_deg()
    return _measuring(recipe, order_deg, tuple(readings_at[angle] for angle in order_deg))


class _Sweeps:
    """Visits of some of the candidates, upwards or downwards, whichever is quicker.

    Parameters
    ----------
    recipe, rig
        What is measured, and with what.
    angles_deg : sequence of float
        The candidates, upwards.
    """

    def __init__(self, recipe: Recipe, rig: Rig, angles_deg: Sequence[float]) -> None:
        self._recipe, self._rig, self._angles_deg = recipe, rig, angles_deg

    def quicker(self, places: Sequence[int]) -> Recipe:
        """The recipe that reads once in each direction."""
        upwards = [self._angles_deg[place] for place in places]
        either = [_measuring(self._recipe, order, 1) for order in (upwards, upwards[::-1])]
        return min(either, key=lambda one: sum(step.duration_s for step in plan(one, self._rig)))

    def cost(self, places: Sequence[int]) -> tuple[float, FloatArray]:
        """Seconds for the visits, and for one more reading at each of the places."""
        sweep = self.quicker(places)
        steps = plan(sweep, self._rig)
        slots = np.bincount([step.point for step in steps])
        in_order = slots if sweep.exit_angles_deg()[0] == self._angles_deg[places[0]] else slots[::-1]
        reading_s = in_order * timing(self._rig, self._recipe).reading_s(self._recipe.exposure_s)
        return sum(step.duration_s for step in steps) - float(reading_s.sum()), np.asarray(reading_s, np.float64)


def _candidates_deg(recipe: Recipe) -> tuple[float, ...]:
    low_deg, high_deg = min(recipe.exit_angles_deg()), max(recipe.exit_angles_deg())
    count = math.ceil((high_deg - low_deg) / STEP_DEG - 1e-9)
    return (*(low_deg + STEP_DEG * number for number in range(count)), high_deg)


def _measuring(recipe: Recipe, angles_deg: Sequence[float], readings: int | tuple[int, ...]) -> Recipe:
    return recipe.model_copy(update={"exit": None, "exit_deg": tuple(angles_deg), "readings": readings})
