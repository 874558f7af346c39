"""What follows from a recipe and a rig before any device is opened: the way, and how readings will be reduced."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from acquisition.adaptive import Adaptive, first_exits_deg
from acquisition.averaged import Averaged
from acquisition.calibrated_slots import SlotCalibration
from acquisition.course import Choice, Course, Listed, Passes
from acquisition.decisions import Decisions
from acquisition.events import Event
from acquisition.expand import HOME, Slots, Step, Visits, expand
from acquisition.expected_noise import Detection
from acquisition.fit_points import surface_family
from acquisition.lamp_level import LARGEST_CHANGE, SIGNIFICANT, LampBreak
from acquisition.readings import Reading
from acquisition.recipe import Recipe
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from acquisition.rotation import rotation_timing, with_rotation
from acquisition.rounds import Rounds
from acquisition.signal_to_noise import Enough, SignalToNoise, as_planned
from acquisition.steering import Steering
from acquisition.timing import AxisTiming, BenchTiming
from acquisition.wavelengths import expand_wavelengths
from drivers.clock import Clock
from goniometer.analyzer_rotation import rotation_of, timing_of
from goniometer.durations import clock_text
from goniometer.rig_devices.entry import AnalyzerEntry, AxesEntry, Role
from goniometer.rig_file import Rig


def plan(recipe: Recipe, rig: Rig) -> tuple[Step, ...]:
    """The steps of a recipe on a rig, every exit angle once, with their durations.

    Where readings are to reach something, the steps have the most that they may take.
    """
    if recipe.averaging is not None and recipe.averaging.dolp_error is not None:
        recipe = recipe.model_copy(update={"direction_within_s": 0.0})
    if recipe.analyzer_rotation is not None:  # one turn ends where the next one begins
        steps = _plan(recipe.model_copy(update={"direction_within_s": 0.0}), rig)
        return with_rotation(steps, rotation_timing(timing(rig, recipe), rotation_of(rig), recipe))
    return _plan(recipe, rig)


def _plan(recipe: Recipe, rig: Rig) -> tuple[Step, ...]:
    bench_timing = timing_of(recipe, rig, timing(rig, recipe))
    if len(recipe.wavelengths_nm()) > 1:
        of_each = {wavelength_nm: slots(rig, wavelength_nm) for wavelength_nm in recipe.wavelengths_nm()}
        return expand_wavelengths(recipe, of_each, bench_timing)
    return expand(recipe, slots(rig, recipe.one_wavelength_nm), bench_timing)


def span_s(recipe: Recipe, rig: Rig) -> tuple[float, float]:
    """The least and the longest time that a recipe takes, but for one whose end a fit decides."""
    steps = plan(recipe, rig)
    longest_s = sum(step.duration_s for step in steps)
    if recipe.averaging is None:
        return longest_s, longest_s
    if recipe.averaging.dolp_error is not None:
        rounds = Rounds(steps, recipe.averaging, timing(rig, recipe), lambda saved_s: None)
        return rounds.shortest_s(), rounds.longest_s()
    reading_s, least = timing(rig, recipe).readings_s, recipe.averaging.at_least
    spared_s = (reading_s(step.readings, step.exposure_s) - reading_s(least, step.exposure_s) for step in steps)
    return longest_s - sum(spared_s), longest_s


def enough(recipe: Recipe, rig: Rig) -> Enough:
    """What says when a step has its readings."""
    if recipe.averaging is None or recipe.averaging.signal_to_noise is None:
        return as_planned
    return SignalToNoise(recipe.averaging.signal_to_noise, recipe.averaging.at_least, detection(recipe, rig).noise)


def averaged(recipe: Recipe, rig: Rig) -> Averaged | None:
    """What compares the readings with what they are to reach; None for a recipe that wants fixed numbers."""
    return None if recipe.averaging is None else Averaged(recipe.averaging, detection(recipe, rig).noise)


def beginning(recipe: Recipe, rig: Rig) -> tuple[Step, ...]:
    """The steps that are known beforehand: of an adaptive scan the first ones, else every exit angle once."""
    if not recipe.adaptive:
        return plan(recipe, rig)
    visits = Visits(recipe, slots(rig, recipe.one_wavelength_nm), timing(rig, recipe))
    steps: list[Step] = []
    family = surface_family(recipe.fit, rig.calibration.acceptance_sr)
    for point, exit_deg in enumerate(first_exits_deg(recipe, family)):
        here = steps[-1].target if steps else HOME
        steps += visits.steps(point, exit_deg, recipe.readings_of_angles()[0], here)
    return tuple(steps)


def course(
    recipe: Recipe,
    rig: Rig,
    clock: Clock,
    publish: Callable[[Event], None],
    saved: Callable[[float], None],
    decisions: Decisions | None = None,
) -> Course:
    """The way a scan takes: the recipe's steps, or what it decides as it goes and then publishes.

    `saved` is told the seconds of the longest plan that it turns out not to need; `decisions` has those that the scan
    has taken before.
    """
    if recipe.averaging is not None and recipe.averaging.dolp_error is not None:
        return Rounds(plan(recipe, rig), recipe.averaging, timing(rig, recipe), saved, decisions)
    if not recipe.follows_fit:
        return Listed(plan(recipe, rig))
    visits = Visits(recipe, slots(rig, recipe.one_wavelength_nm), timing(rig, recipe))
    family = surface_family(recipe.fit, rig.calibration.acceptance_sr)
    choose: Choice = Passes(recipe)
    if recipe.adaptive:
        choose = Adaptive(recipe, visits, family, detection(recipe, rig))
    return Steering(recipe, visits, family, choose, clock, publish, decisions)


def references(recipe: Recipe, rig: Rig) -> Callable[[int], tuple[Step, ...]]:
    """The steps by which the lamp is read once more at a point, besides the plan; none without references."""
    listed, directions = recipe.wavelengths_nm(), len(recipe.directions_deg())

    def at(point: int) -> tuple[Step, ...]:
        wavelength_nm = listed[point // directions]
        visits = Visits(recipe.at_wavelength(wavelength_nm), slots(rig, wavelength_nm), timing(rig, recipe))
        steps = visits.closing(point, HOME)
        if recipe.averaging is None or recipe.averaging.dolp_error is None:
            return steps
        return tuple(replace(step, readings=recipe.averaging.at_least) for step in steps)

    return at


def alike(recipe: Recipe, rig: Rig) -> Callable[[Reading, Reading], bool]:
    """Whether two readings at the same place may be of the same light, but for noise and a lamp that drifts."""
    largest_change = recipe.reference.largest_change if recipe.reference else LARGEST_CHANGE

    def are_alike(before: Reading, now: Reading) -> bool:
        powers_w = np.array([before.power_w, now.power_w])
        expected = noise(rig, now.wavelength_nm or recipe.wavelengths_nm()[0])
        stderr_w = math.sqrt(expected.variance(powers_w, np.array([before.exposure_s, now.exposure_s])).sum())
        return bool(np.ptp(powers_w) <= SIGNIFICANT * stderr_w + largest_change * np.abs(powers_w).max())

    return are_alike


def aim(recipe: Recipe, rig: Rig) -> str:
    """What a scan that decides as it goes is after; empty for one that takes the recipe's steps."""
    if recipe.averaging is not None:
        shortest_s, longest_s = span_s(recipe, rig)
        directions = f"{len({step.point for step in plan(recipe, rig)})} directions"
        return f"{directions}, {recipe.averaging}, {clock_text(shortest_s)} to {clock_text(longest_s)}"
    if recipe.time_limit_s is None:
        return ""
    way = "adaptive" if recipe.adaptive else "passes over the exit angles"
    wanted = " and ".join(f"{name} ± {error:g}" for name, error in recipe.wanted.items())
    return f"{way}{f' until {wanted}' if wanted else ''}, for at most {clock_text(recipe.time_limit_s)}"


def slots(rig: Rig, wavelength_nm: float | None = None) -> Slots:
    """What the rig's analyzer holds in which slot, its generator, and where its filter of a wavelength is, if any."""
    generator = None if rig.generator is None else _slots_of(rig.generator)
    filter_slot = None if rig.filters is None or wavelength_nm is None else rig.filters.slots.get(wavelength_nm)
    return replace(_slots_of(rig.analyzer), generator=generator, filter_slot=filter_slot)


def _slots_of(device: AnalyzerEntry) -> Slots:
    held = device.contents()
    return Slots(
        polarizers={float(content): slot for slot, content in held.items() if not isinstance(content, str)},
        offset_deg=device.offset_deg,
        blocked=next((slot for slot, content in held.items() if content == "blocked"), None),
        open=next((slot for slot, content in held.items() if content == "open"), None),
        retarded=device.retarded(),
    )


def timing(rig: Rig, recipe: Recipe | None = None) -> BenchTiming:
    """The speeds that the rig file states, with as many exposures of a camera in each reading as a recipe asks for."""
    axes: dict[Role, AxisTiming] = {}
    for device in rig.devices.values():
        if isinstance(device, AxesEntry):
            axes |= device.timing()
    detector = rig.detector.timing
    if recipe is not None and recipe.imaging is not None:
        detector = replace(detector, exposures=recipe.imaging.exposures)
    return BenchTiming(
        axes["source_arm"],
        axes["detector_arm"],
        axes["sample_azimuth"],
        rig.analyzer.timing(axes),
        rig.zones,
        detector,
        axes.get("detector_azimuth"),
        None if rig.generator is None else rig.generator.timing(axes),
        None if rig.filters is None else rig.filters.timing,
    )


def reduction(
    recipe: Recipe, rig: Rig, calibration: SlotCalibration | None = None, suspended: Sequence[LampBreak] = ()
) -> Reduction:
    """The reduction that the rig's radiometry, its detector's noise and the calibration of its analyzer ask for.

    Nothing is made of what was read while the scan was suspended.
    """
    assert (calibration is None) == (recipe.calibration is None), "a recipe that names a calibration is reduced by it"
    expected = detection(recipe, rig)
    return Reduction(
        expected.radiometry,
        expected.noise,
        has_dark=recipe.dark,
        largest_change=LARGEST_CHANGE if recipe.reference is None else recipe.reference.largest_change,
        calibration=calibration,
        suspended=suspended,
    )


def detection(recipe: Recipe, rig: Rig, dark_w: float = 0.0) -> Detection:
    """What makes readings of light on a rig whose detector shows so much power in the dark."""
    return Detection(
        Radiometry(
            rig.beam_power_w(recipe.one_wavelength_nm),
            rig.calibration.acceptance_sr,
            sees_whole_spot=rig.detector.sees_whole_spot,
        ),
        noise(rig, recipe.one_wavelength_nm),
        dark_w,
    )


def noise(rig: Rig, wavelength_nm: float) -> NoiseModel:
    """The noise that the rig file states of its detector."""
    return rig.detector.noise_model(wavelength_nm)
