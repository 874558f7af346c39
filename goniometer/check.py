"""`goniometer check`: what a recipe will do and how long it will take, said before anything moves."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from acquisition.analyzer_matrix import analyzer_matrix
from acquisition.expand import Step
from acquisition.recipe import Recipe
from goniometer.durations import clock_text
from goniometer.load_files import Setup
from goniometer.planning import aim, beginning


def describe_plan(setup: Setup) -> str:
    """The steps of a recipe, a line a direction, with the time at which each ends; as far as they are known."""
    steps = beginning(setup.recipe, setup.rig)
    lines = [
        *_heading(setup.recipe, steps),
        f"rig: {setup.rig.rig} ({setup.rig_path})",
        f"analyzer: {_told(steps)}",
        "",
        " point  incidence     exit  azimuth  analyzer slots       ends at",
    ]
    elapsed_s = 0.0
    for (point, kind_is_reference), group in groupby(steps, key=lambda step: (step.point, step.kind == "reference")):
        of_point = list(group)
        elapsed_s += sum(step.duration_s for step in of_point)
        lines.append(_line(point, of_point, elapsed_s) + ("  reference" if kind_is_reference else ""))
    return "\n".join([*lines, *_outlook(setup.recipe, elapsed_s), "", "Nothing was moved."])


def _told(steps: Sequence[Step]) -> str:
    """What the analyzer's settings tell, and by how much they may enlarge errors."""
    matrix = analyzer_matrix([step.analyzer for step in steps if step.kind == "signal"])
    return f"S0 to S{matrix.shape[1] - 1}, condition number {np.linalg.cond(matrix):.3g}"


def _heading(recipe: Recipe, steps: Sequence[Step]) -> list[str]:
    total_s = sum(step.duration_s for step in steps)
    amount = (
        f"{len({step.point for step in steps})} directions, {len(steps)} steps, "
        f"{sum(step.readings for step in steps)} readings, {clock_text(total_s)}"
    )
    if not recipe.is_steered:
        return [f"{recipe.recipe}: {amount}"]
    return [f"{recipe.recipe}: {aim(recipe)}", f"{'at first' if recipe.adaptive else 'one pass'}: {amount}"]


def _outlook(recipe: Recipe, elapsed_s: float) -> list[str]:
    """What follows the steps that are known beforehand."""
    if recipe.time_limit_s is None:
        return []
    if elapsed_s > recipe.time_limit_s:
        return ["", f"The time limit of {recipe.time_limit_s:g} s ends the scan before all of these are measured."]
    if not recipe.adaptive:
        return ["", "Then back again, and so on."]
    exit_deg = sorted(set(recipe.exit_angles_deg()))
    return [
        "",
        f"Then at whichever of {len(exit_deg)} exit angles, {exit_deg[0]:g}° to {exit_deg[-1]:g}°, readings tell most "
        f"per second, {recipe.readings_of_angles()[0]} or more in every slot.",
    ]


def _line(point: int, steps: list[Step], elapsed_s: float) -> str:
    target = steps[0].target
    slots = " ".join(str(step.target.slot) for step in steps)
    return (
        f"{point:6d}  {target.incidence_deg:8.3f}°  {target.exit_deg:7.3f}°  {target.azimuth_deg:6.2f}°  "
        f"{slots:<18}  {clock_text(elapsed_s):>8}"
    )
