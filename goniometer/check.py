"""`goniometer check`: what a recipe will do and how long it will take, said before anything moves."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from operator import ne

import numpy as np

from acquisition.expand import HOME, Step, Target
from acquisition.recipe import Recipe
from acquisition.settings_matrix import condition, settings_shape
from goniometer.durations import clock_text
from goniometer.imaging.pictures import picture_lines
from goniometer.load_files import Setup
from goniometer.planning import aim, beginning
from goniometer.rig_devices.entry import PLACING, Role

_BYTES_PER_READING = 100
_MOST_NAMED = 8
"""Slots that a line names one by one."""


def describe_plan(setup: Setup) -> str:
    """What a recipe comes to, and its steps, a line a direction or a sweep, with the time at which each ends."""
    steps = beginning(setup.recipe, setup.rig)
    named = "analyzer slots" if steps[0].target.generator is None else "generator/analyzer"
    if steps[0].rotation is not None:
        named = "turns"
    lines = [
        *_heading(setup, steps),
        f"rig: {setup.rig.rig} ({setup.rig_path})",
        f"{'analyzer' if steps[0].target.generator is None else 'generator and analyzer'}: {_told(steps)}",
        *_filters(steps),
        f"travel: {_travel(steps, [role for role in PLACING if role in setup.rig.axes()])}",
        f"data: about {_size(sum(step.readings for step in steps))} in the journal",
        *picture_lines(
            setup.recipe, setup.rig, sum(step.readings for step in steps), len({step.point for step in steps})
        ),
        *_apart(steps),
        "",
    ]
    out_of_plane = "detector_azimuth" in setup.rig.axes()
    aside = "  exit azimuth" if out_of_plane else ""
    lines.append(f"{'points':>15}  incidence  {'exit':>20}  azimuth{aside}  {named:<18}   ends at")
    elapsed_s = 0.0
    wavelength_nm = steps[0].wavelength_nm
    several = any(step.wavelength_nm != wavelength_nm for step in steps)
    for number, run in enumerate(_runs(steps)):
        if several and (number == 0 or run[0].wavelength_nm != wavelength_nm):
            wavelength_nm = run[0].wavelength_nm
            lines.append(f"at {wavelength_nm:g} nm:")
        elapsed_s += sum(step.duration_s for step in run)
        lines.append(_line(run, elapsed_s, out_of_plane=out_of_plane))
    return "\n".join([*lines, *_outlook(setup.recipe, elapsed_s), "", "Nothing was moved."])


def _told(steps: Sequence[Step]) -> str:
    """What the settings tell, and by how much they may enlarge errors."""
    if (rotation := steps[0].rotation) is not None:
        turn = list(rotation.states(steps[0].readings, steps[0].exposure_s))
        matrix = [(state, steps[0].made) for state in turn]
        turning = f"{rotation.element} turning at {rotation.axis.velocity_deg_s:g}°/s, {len(turn)} readings a turn"
        return f"{turning}, S0 to S{settings_shape(matrix)[0] - 1}, condition number {condition(matrix):.3g}"
    of_slots = {_slots(step): step for step in steps if step.kind == "signal"}
    settings = [(step.analyzer, step.made) for step in of_slots.values()]
    rows, columns = settings_shape(settings)
    told = f"S0 to S{rows - 1}"
    if columns > 1:
        told = f"{len(settings)} settings for {rows * columns} elements of the Mueller matrix, {rows} x {columns}"
    return f"{told}, condition number {condition(settings):.3g}"


def _filters(steps: Sequence[Step]) -> list[str]:
    """Which filters come into the beam, in which order; nothing where the light has a wavelength of its own."""
    found = dict.fromkeys((step.wavelength_nm, step.target.filter_slot) for step in steps)
    told = [f"{wavelength_nm:g} nm (slot {slot})" for wavelength_nm, slot in found if slot is not None]
    return [f"filters: {', then '.join(told)}"] if told else []


def _heading(setup: Setup, steps: Sequence[Step]) -> list[str]:
    recipe = setup.recipe
    total_s = sum(step.duration_s for step in steps)
    amount = (
        f"{len({step.point for step in steps})} directions, {len(steps)} steps, "
        f"{sum(step.readings for step in steps)} readings, {clock_text(total_s)}"
    )
    if not recipe.is_steered:
        return [f"{recipe.recipe}: {amount}"]
    known = "at first" if recipe.adaptive else "one pass" if recipe.follows_fit else "with the most readings"
    return [f"{recipe.recipe}: {aim(recipe, setup.rig)}", f"{known}: {amount}"]


def _travel(steps: Sequence[Step], roles: Sequence[Role]) -> str:
    """How far each axis goes, and how often the analyzer changes its slot, from home."""
    places = [HOME, *(step.target for step in steps)]
    angles_deg = np.array([place.angles_deg for place in places])
    ways_deg = np.abs(np.diff(angles_deg, axis=0)).sum(axis=0)[: len(roles)]
    axes = ", ".join(f"{role.replace('_', ' ')} {way_deg:.0f}°" for role, way_deg in zip(roles, ways_deg, strict=True))
    if steps[0].rotation is not None:
        return f"{axes}, analyzer {len(steps)} turns"
    changes = sum(one.slot != other.slot for one, other in itertools.pairwise(places))
    turns = sum(one.generator != other.generator for one, other in itertools.pairwise(places))
    of_generator = f", generator {turns}" if turns else ""
    return f"{axes}, analyzer {changes}{of_generator} changes of slot"


def _size(readings: int) -> str:
    size = readings * _BYTES_PER_READING / 1000
    return f"{size:.0f} kB" if size < 1000 else f"{size / 1000:.3g} MB"


def _apart(steps: Sequence[Step]) -> list[str]:
    """How long the readings of one direction take, and so the lamp must keep."""
    begun_s: dict[tuple[int, int], float] = {}
    now_s = longest_s = 0.0
    for step in steps:
        now_s += step.duration_s
        if step.kind != "reference":
            begin_s = now_s - step.readings * step.reading_s
            longest_s = max(longest_s, now_s - begun_s.setdefault((step.point, step.cycle), begin_s))
    return [f"the readings of a direction are taken within {clock_text(longest_s)}"]


def _runs(steps: Sequence[Step]) -> Iterator[list[Step]]:
    """Steps that follow one another in one direction, or through one slot."""
    run: list[Step] = []
    for step in steps:
        if run and not _goes_on(run, step):
            yield run
            run = []
        run.append(step)
    yield run


def _goes_on(run: Sequence[Step], step: Step) -> bool:
    last = run[-1]
    if step.target.filter_slot != last.target.filter_slot:
        return False
    if step.kind != last.kind and "reference" in (step.kind, last.kind):
        return False
    if len(run) == 1:
        return step.point == last.point or _slots(step) == _slots(last)
    if run[0].point == last.point or _slots(step) != _slots(last):
        return run[0].point == last.point and step.point == last.point
    return _moving(last.target, step.target) in (_moving(run[0].target, run[1].target), (False,) * 4)


def _slots(step: Step) -> tuple[int | None, int]:
    return step.target.generator, step.target.slot


def _moving(here: Target, there: Target) -> tuple[bool, ...]:
    """Which axes go: a line of the plan is along the same ones."""
    return tuple(map(ne, here.angles_deg, there.angles_deg))


def _settings_text(run: Sequence[Step]) -> str:
    """Slots in their order, those of the generator before those of the analyzer; of many, the first and the last."""
    named = [
        f"{slot}" if generator is None else f"{generator}/{slot}" for generator, slot in dict.fromkeys(map(_slots, run))
    ]
    return " ".join(named) if len(named) <= _MOST_NAMED else f"{named[0]} to {named[-1]}, {len(named)}"


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


def _line(run: Sequence[Step], elapsed_s: float, *, out_of_plane: bool) -> str:
    first, last = run[0], run[-1]
    points = f"{first.point}" if last.point == first.point else f"{first.point} to {last.point}"
    incidence = _ends(first.target.incidence_deg, last.target.incidence_deg, 3)
    exits = _ends(first.target.exit_deg, last.target.exit_deg, 3, is_range=last.point != first.point)
    azimuth = _ends(first.target.azimuth_deg, last.target.azimuth_deg, 2)
    if out_of_plane:
        azimuth = f"{azimuth:>7}  {_ends(first.target.exit_azimuth_deg, last.target.exit_azimuth_deg, 2):>12}"
    slots = _settings_text(run) if first.rotation is None else f"{len(run)}"
    return f"{points:>15}  {incidence:>9}  {exits:>20}  {azimuth:>7}  {slots:<18}  {clock_text(elapsed_s):>8}" + (
        "  reference" if first.kind == "reference" else ""
    )


def _ends(first_deg: float, last_deg: float, decimals: int, *, is_range: bool = False) -> str:
    if first_deg == last_deg and not is_range:
        return f"{first_deg:.{decimals}f}°"
    return f"{first_deg:.{decimals}f}° to {last_deg:.{decimals}f}°"
