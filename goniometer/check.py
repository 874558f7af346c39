"""`goniometer check`: what a recipe will do and how long it will take, said before anything moves."""

from __future__ import annotations

from itertools import groupby

from acquisition.expand import Step
from goniometer.durations import clock_text
from goniometer.load_files import Setup
from goniometer.planning import plan


def describe_plan(setup: Setup) -> str:
    """The steps of a recipe, a line a direction, with the time at which each ends."""
    steps = plan(setup.recipe, setup.rig)
    total_s = sum(step.duration_s for step in steps)
    lines = [
        f"{setup.recipe.recipe}: {len({step.point for step in steps})} directions, {len(steps)} steps, "
        f"{sum(step.readings for step in steps)} readings, {clock_text(total_s)}",
        f"rig: {setup.rig.rig} ({setup.rig_path})",
        "",
        " point  incidence     exit  azimuth  analyzer slots       ends at",
    ]
    elapsed_s = 0.0
    for (point, kind_is_reference), group in groupby(steps, key=lambda step: (step.point, step.kind == "reference")):
        of_point = list(group)
        elapsed_s += sum(step.duration_s for step in of_point)
        lines.append(_line(point, of_point, elapsed_s) + ("  reference" if kind_is_reference else ""))
    return "\n".join([*lines, "", "Nothing was moved."])


def _line(point: int, steps: list[Step], elapsed_s: float) -> str:
    target = steps[0].target
    slots = " ".join(str(step.target.slot) for step in steps)
    return (
        f"{point:6d}  {target.incidence_deg:8.3f}°  {target.exit_deg:7.3f}°  {target.azimuth_deg:6.2f}°  "
        f"{slots:<18}  {clock_text(elapsed_s):>8}"
    )
