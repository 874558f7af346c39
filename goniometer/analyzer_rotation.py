"""How the analyzer of a rig turns while it is read: whether it can, how it is planned, and as a device of the bench."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from acquisition.analyzer_matrix import AnalyzerState, check_states
from acquisition.engine import Bench
from acquisition.recipe import Recipe
from acquisition.rotation import Rotation, RotationTiming, rotation_timing
from acquisition.timing import AxisTiming, BenchTiming
from drivers.rotating_analyzer import RotatingAnalyzer, SlotAngles
from goniometer.errors import ReductionError
from goniometer.rig_devices.entry import AxesEntry, Role
from goniometer.rig_devices.rotating_polarizer import RotatingPolarizerEntry
from goniometer.rig_file import Rig
from goniometer.yaml_file import Fault, YamlFile

_KEY = ("analyzer_rotation",)


def rotation_of(rig: Rig) -> Rotation:
    """How the analyzer turns, on a rig that `rotation_on_rig` accepts."""
    analyzer = rig.analyzer
    assert isinstance(analyzer, RotatingPolarizerEntry), "a recipe is only accepted on such a rig"
    (element,) = analyzer.turns
    fixed = next(iter(analyzer.retarded().values()), AnalyzerState(0.0))
    fixed = replace(fixed, polarizer_deg=0.0) if element == "polarizer" else replace(fixed, retarder_deg=0.0)
    timings: dict[Role, AxisTiming] = {}
    for device in rig.devices.values():
        if isinstance(device, AxesEntry):
            timings |= device.timing()
    return Rotation(element, timings[analyzer.role(element)], fixed, analyzer.offset_deg)


def timing_of(recipe: Recipe, rig: Rig, standing: BenchTiming) -> BenchTiming:
    """The timing of a bench for a recipe, given that of the bench with its analyzer standing in its slots."""
    return standing if recipe.analyzer_rotation is None else rotation_timing(standing, rotation_of(rig), recipe)


def turning(bench: Bench, rig: Rig) -> Bench:
    """The bench with an analyzer that has the ends of its way as slots."""
    rotation = rotation_of(rig)
    ends = {slot: SlotAngles(**{f"{rotation.element}_deg": angle_deg}) for slot, angle_deg in rotation.ends_deg.items()}
    polarizer = bench.polarizer if rotation.element == "polarizer" else None
    retarder = bench.retarder if rotation.element == "retarder" else None
    return replace(bench, analyzer=RotatingAnalyzer(polarizer, retarder, name=bench.analyzer.name, slots=ends))


def rotation_on_rig(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path, standing: BenchTiming) -> Iterator[Fault]:
    """Why the analyzer of a rig cannot turn as a recipe asks, or what it passed would not tell the polarization."""
    faults = list(_device_faults(file, rig, rig_path))
    if not faults:
        rotation = rotation_of(rig)
        faults += _limit_faults(rotation, file, rig, rig_path)
        faults += _reading_faults(recipe, file, rig_path, rotation_timing(standing, rotation, recipe))
    yield from faults


def _device_faults(file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    analyzer = rig.analyzer
    if not isinstance(analyzer, RotatingPolarizerEntry):
        yield file.fault(
            _KEY,
            f"needs an analyzer that can turn, driver rotating_polarizer; that of {rig_path} is {analyzer.driver}. "
            "Write analyzer_deg instead",
        )
        return
    if len(analyzer.turns) > 1:
        both = f"both polarizer and retarder of {rig_path} turn"
        yield file.fault(_KEY, f"turns one element, and {both}. Write analyzer_deg instead")
        return
    role = analyzer.role(analyzer.turns[0])
    carrier = next(device for device in rig.devices.values() if isinstance(device, AxesEntry) and role in device.axes)
    if not carrier.reports_in_motion:
        yield file.fault(
            _KEY,
            f"needs a rotator that says where it is while it turns; {carrier.driver}, which turns the {role} in "
            f"{rig_path}, does not. Write analyzer_deg instead, or use another rotator",
        )
    axis = carrier.axes[role]
    if axis.wraps:
        yield file.fault(_KEY, f"turns forwards and backwards, but {role} in {rig_path} has wraps: true; take it out")
    if axis.backlash_deg:
        yield file.fault(
            _KEY,
            f"needs a rotator without play: {role} in {rig_path} has a backlash_deg of {axis.backlash_deg:g}, by which "
            "turns forwards and backwards would differ. Write analyzer_deg instead, or use another rotator",
        )
    if not rig.detector.averages_evenly:
        yield file.fault(
            _KEY,
            f"needs a detector that averages evenly over its exposure; {rig.detector.driver} in {rig_path} filters its "
            "signal instead. Write analyzer_deg",
        )


def _limit_faults(rotation: Rotation, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    low_deg, high_deg = rig.axes()[rotation.element].limits_deg
    end_deg = rotation.end_deg
    if low_deg > -end_deg or high_deg < end_deg:
        needed = math.ceil(end_deg)
        yield file.fault(
            _KEY,
            f"needs the {rotation.element} to go from {-needed} to {needed} degrees: a turn, and the way on which it "
            f"gathers speed and loses it; limits_deg in {rig_path} are {low_deg:g} to {high_deg:g}. Widen them if it "
            "can truly go there, or lower its velocity_deg_s",
        )


def _reading_faults(recipe: Recipe, file: YamlFile, rig_path: Path, timing: RotationTiming) -> Iterator[Fault]:
    rotation = timing.rotation
    assert rotation is not None, "it is the timing of a rotation"
    exposure_s = recipe.exposure_s
    spacing_s, most = timing.shortest_spacing_s(exposure_s), max(recipe.readings_of_angles())
    if most > (fitting := int(rotation.turn_s / spacing_s)):
        yield file.fault(
            ("readings",),
            f"got {most}; allowed: at most {fitting}, because in {rig_path} a turn of the {rotation.element} takes "
            f"{rotation.turn_s:.3g} s at velocity_deg_s, and a reading of {exposure_s:g} s {spacing_s:.3g} s",
        )
        return
    try:
        check_states(rotation.states(min(recipe.readings_of_angles()), exposure_s))
    except ReductionError as error:
        sweep_deg = rotation.axis.velocity_deg_s * exposure_s
        yield file.fault(
            ("exposure_s",), f"got {exposure_s:g}, in which the analyzer turns by {sweep_deg:.3g} degrees: {error}"
        )
