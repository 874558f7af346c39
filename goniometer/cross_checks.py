"""Whether recipe, rig and scene fit together, once each is valid by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from acquisition.analyzer_matrix import AnalyzerState, check_states
from acquisition.exit_angles import AngleRange
from acquisition.generator import GeneratorState
from acquisition.point_table import NAMES
from acquisition.recipe import Recipe
from acquisition.settings_matrix import check_settings
from acquisition.steps import Slots
from goniometer.analyzer_rotation import rotation_on_rig
from goniometer.collision_zones import blocked_ways
from goniometer.errors import ReductionError
from goniometer.imaging.on_rig import imaging_faults
from goniometer.imaging.on_scene import marker_faults
from goniometer.planning import beginning, plan, slots, timing
from goniometer.rig_devices.entry import PLACING, AnalyzerEntry, Role
from goniometer.rig_file import Rig
from goniometer.yaml_file import Fault, KeyPath, YamlFile
from model.acceptance import WIDEST_RAD, half_angle_rad
from sim_devices.scene import Scene

_MOST_WAYS = 20
"""Collisions on the way of a scan that are listed; behind so many, more tell nothing new."""

_SAME_DURATION = 1e-6
"""Relative difference up to which an exposure is a whole number of samples."""


def recipe_on_rig(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Whatever a recipe asks that its rig cannot do, at the recipe's own lines."""
    yield from _slot_faults(recipe, file, rig, rig_path)
    yield from _angle_faults(recipe, file, rig, rig_path)
    if recipe.fit.bounces > 1 and half_angle_rad(rig.calibration.acceptance_sr) > WIDEST_RAD:
        yield file.fault(
            ("fit", "bounces"),
            f"got {recipe.fit.bounces}; allowed: 1, because the detector of {rig_path} accepts "
            f"{rig.calibration.acceptance_sr:g} sr (acceptance_sr), a wider cone than {math.degrees(WIDEST_RAD):g}° to "
            "each side, and more bounces are averaged over it",
        )
    yield from exposure_faults(recipe.exposure_s, file, rig, rig_path)
    yield from imaging_faults(recipe, file, rig, rig_path)
    yield from filter_faults(recipe.wavelengths_nm(), file, rig, rig_path)
    if rig.is_simulated and recipe.scene is None:
        yield file.fault(
            ("scene",), f"is missing, but {rig_path} is simulated. Name a scene file, or a rig of real devices"
        )


def exposure_faults(exposure_s: float, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Whether the detector can read for so long."""
    sample_s = rig.detector.sample_s
    samples = max(1, round(exposure_s / sample_s))
    if samples > rig.detector.most_samples:
        longest_s = rig.detector.most_samples * sample_s
        yield file.fault(
            ("exposure_s",),
            f"got {exposure_s:g}; allowed: at most {longest_s:g}, the most that the detector in {rig_path} "
            "averages. Take more readings instead",
        )
    if abs(exposure_s - samples * sample_s) > _SAME_DURATION * exposure_s:
        yield file.fault(
            ("exposure_s",),
            f"got {exposure_s:g}; allowed: a whole number of the detector's samples of {sample_s:g} s (sample_s "
            f"in {rig_path}), the nearest is {samples * sample_s:g}",
        )


def filter_faults(wavelengths_nm: Sequence[float], file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Wavelengths that no filter of the rig has, or several of them behind a retarder, which holds at one."""
    if rig.filters is None:
        if len(wavelengths_nm) > 1:
            yield file.fault(
                ("wavelength_nm",),
                f"asks for {len(wavelengths_nm)} wavelengths; allowed: one, because {rig_path} has no wheel of filters",
            )
        return
    retarding = [part for part in (rig.analyzer, rig.generator) if part is not None and part.retarded()]
    if retarding and len(wavelengths_nm) > 1:
        yield file.fault(
            ("wavelength_nm",),
            f"asks for {len(wavelengths_nm)} wavelengths; allowed: one, because the retarder of the "
            f"{retarding[0].part} in {rig_path} has another retardance at each. Write one of them, with its retardance "
            "in the rig file",
        )
    known = ", ".join(f"{wavelength_nm:g}" for wavelength_nm in rig.filters.slots)
    for number, wavelength_nm in enumerate(wavelengths_nm):
        if wavelength_nm not in rig.filters.slots:
            place = ("wavelength_nm", number) if len(wavelengths_nm) > 1 else ("wavelength_nm",)
            yield file.fault(place, f"got {wavelength_nm:g}; allowed: those of the filters of {rig_path}, {known}")


def _slot_faults(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    contents = set(rig.analyzer.contents().values())
    if recipe.analyzer_rotation is None:
        faults = list(_setting_faults(recipe.settings(), rig.analyzer, "analyzer", file, rig_path))
    else:
        faults = list(rotation_on_rig(recipe, file, rig, rig_path, timing(rig, recipe)))
    faults += _generator_faults(recipe, file, rig, rig_path)
    yield from faults
    if recipe.generator_deg is not None and not faults:
        yield from _together_faults(recipe, file, slots(rig))
    if recipe.dark and "blocked" not in contents:
        yield file.fault(
            ("dark",), f"needs a blocked slot, which {rig_path} does not have. Write 'dark: false', or block a slot"
        )
    if recipe.reference is not None and "open" not in contents:
        yield file.fault(("reference",), f"needs an open slot, which {rig_path} does not have. Leave reference out")


def _generator_faults(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Whether there is a generator for exactly those recipes that name its settings, and whether it has them."""
    if rig.generator is not None and recipe.generator_deg is not None:
        yield from _setting_faults(recipe.generator_settings(), rig.generator, "generator", file, rig_path)
    elif rig.generator is not None:
        what = f"is missing: light always passes the generator of {rig_path}"
        yield file.fault(("generator_deg",), f"{what}. Add the angles of its polarizer, or name a rig without it")
    elif recipe.generator_deg is not None:
        what = f"is given, but there is no generator in {rig_path}"
        yield file.fault(("generator_deg",), f"{what}. Leave it out, or name another rig")


def _together_faults(recipe: Recipe, file: YamlFile, held: Slots) -> Iterator[Fault]:
    """Whether settings that do by themselves tell the Mueller matrix together."""
    assert held.generator is not None, "asked only where recipe and rig have a generator"
    made = [held.generator.signal(*setting)[1] for setting in recipe.generator_settings()]
    seen = [held.signal(*setting)[1] for setting in recipe.settings()]
    try:
        check_settings([(analyzer, GeneratorState.of(generator)) for generator in made for analyzer in seen])
    except ReductionError as error:
        yield file.fault(("generator_deg",), str(error))


def _setting_faults(
    settings: Sequence[tuple[float, float | None]],
    device: AnalyzerEntry,
    element: Literal["analyzer", "generator"],
    file: YamlFile,
    rig_path: Path,
) -> Iterator[Fault]:
    """Settings of analyzer or generator that the rig does not have, or that do not tell what they depend on."""
    of_polarizer = f"{element}_deg"
    of_retarder = "retarder_deg" if element == "analyzer" else "generator_retarder_deg"
    held = [AnalyzerState(content) for content in device.contents().values() if not isinstance(content, str)]
    held += device.retarded().values()
    has_retarder = bool(device.retarded())
    if has_retarder != (settings[0][1] is not None):
        what = "is missing: light always passes the retarder" if has_retarder else "is given, but there is no retarder"
        remedy = f"Add one angle for each of {of_polarizer}" if has_retarder else "Leave it out, or name another rig"
        yield file.fault((of_retarder,), f"{what} of {rig_path}. {remedy}")
        return
    states = {(state.polarizer_deg, state.retarder_deg): state for state in held}
    known = ", ".join(map(str, held)) or "none"
    named = "pairs of retarder and polarizer angle" if has_retarder else "polarizer angles"
    for number, setting in enumerate(settings):
        if setting not in states:
            place = (of_polarizer if setting[1] is None else of_retarder, number)
            found = AnalyzerState(*setting)
            yield file.fault(place, f"got {found}; allowed: the {named} of {rig_path}, which are {known}")
    if not states.keys() >= set(settings):
        return
    try:
        check_states([states[setting] for setting in settings], element=element)
    except ReductionError as error:
        yield file.fault((of_retarder if has_retarder else of_polarizer,), str(error))


def _angle_faults(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    for role, place, angle in _angles(recipe):
        if role not in rig.axes():
            if angle:
                yield file.fault(
                    place, f"asks for {angle:g} degrees; allowed: 0, because {rig_path} has no axis {role}"
                )
            continue
        low, high = rig.axes()[role].travel.reachable_deg
        if not low <= angle <= high:
            yield file.fault(
                place, f"asks for {angle:g} degrees; allowed: {low:g} to {high:g}, the limits of {role} in {rig_path}"
            )


def _angles(recipe: Recipe) -> Iterator[tuple[Role, KeyPath, float]]:
    """The angles that axes are sent to, with their places; of a range, its ends."""
    if recipe.has_points:
        yield from _point_angles(recipe)
    else:
        yield from _listed_angles("source_arm", ("incidence_deg",), recipe.incidence_deg)
        yield from _listed_angles("sample_azimuth", ("azimuth_deg",), recipe.azimuth_deg)
        yield from _listed_angles("detector_azimuth", ("exit_azimuth_deg",), recipe.exit_azimuth_deg)
        yield from _listed_angles("detector_arm", ("exit",), recipe.exit)
        yield from _listed_angles("detector_arm", ("exit_deg",), recipe.exit_deg)
    if recipe.reference is not None:
        yield "detector_arm", ("reference", "exit_deg"), recipe.reference.exit_deg
        yield "detector_azimuth", ("reference", "exit_deg"), 0.0  # it lies in the plane of incidence


def _listed_angles(
    role: Role, key: KeyPath, angles: float | tuple[float, ...] | AngleRange | None
) -> Iterator[tuple[Role, KeyPath, float]]:
    if isinstance(angles, AngleRange):
        yield role, (*key, "start_deg"), angles.angles_deg()[0]
        yield role, (*key, "stop_deg"), angles.angles_deg()[-1]
    elif isinstance(angles, tuple):
        yield from ((role, (*key, number), angle) for number, angle in enumerate(angles))
    elif angles is not None:
        yield role, key, angles


def _point_angles(recipe: Recipe) -> Iterator[tuple[Role, KeyPath, float]]:
    """The angles of every point; of a table, which has no places in the recipe, the ends of each column."""
    for role, name, angles_deg in zip(PLACING, NAMES, recipe.directions_deg().T, strict=True):
        if isinstance(recipe.points, str):
            yield from ((role, ("points",), angle) for angle in {float(angles_deg.min()), float(angles_deg.max())})
        else:
            yield from ((role, ("points", number, name), angle) for number, angle in enumerate(angles_deg.tolist()))


def path_on_rig(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Whether a scan can be run without a collision; for a recipe and a rig that fit together."""
    if not rig.zones:
        return
    key = ("points",) if recipe.has_points else ("exit",) if recipe.exit is not None else ("exit_deg",)
    # an adaptive scan may go from any of its angles to any other, and so from end to end
    travels = {role: axis.travel for role, axis in rig.axes().items()}
    for number, blocked in enumerate(blocked_ways(plan(recipe, rig), rig.zones, travels)):
        if number == _MOST_WAYS:
            yield file.fault(key, "leads through collision zones on further ways, which are not listed")
            return
        here, there = (
            "/".join(f"{angle:g}" for role, angle in place.axes_deg.items() if role in travels) for place in blocked
        )
        angles = "incidence/exit/azimuth/exit azimuth" if "detector_azimuth" in travels else "incidence/exit/azimuth"
        yield file.fault(
            key,
            f"leads through a collision zone: from {angles} {here} to {there} degrees no order of moves "
            f"keeps out of the collision_zones of {rig_path}. Leave those angles out",
        )


def time_limit_on_rig(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Whether a scan that decides as it goes has time for a direction; for a recipe and a rig that fit together."""
    if recipe.time_limit_s is None:
        return
    first_s = sum(step.duration_s for step in beginning(recipe, rig) if step.point == 0)
    if first_s > recipe.time_limit_s:
        yield file.fault(
            ("time_limit_s",),
            f"got {recipe.time_limit_s:g}; allowed: at least {math.ceil(first_s)}, because the first direction takes "
            f"so long on {rig_path}",
        )


def recipe_on_scene(recipe: Recipe, file: YamlFile, scene: Scene, scene_path: Path) -> Iterator[Fault]:
    """Whatever a recipe asks that its scene does not hold, at the recipe's own lines."""
    lamp_nm = scene.lamp.wavelength_nm
    wavelength_nm, *others = recipe.wavelengths_nm()
    if not others and lamp_nm is not None and wavelength_nm != lamp_nm:
        yield file.fault(("wavelength_nm",), f"got {wavelength_nm:g}; allowed: {lamp_nm:g}, the lamp's in {scene_path}")


def scene_on_rig(scene: Scene, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Where the devices that a scene simulates are not those of the rig, at the scene's own lines."""
    for name, device in scene.devices.items():
        if name not in rig.devices:
            names = ", ".join(rig.devices)
            yield file.fault(("devices", name), f"is not a device of {rig_path}; its devices are {names}")
        elif device.type != rig.devices[name].driver:
            yield file.fault(
                ("devices", name, "type"),
                f"got {device.type}; allowed: {rig.devices[name].driver}, the driver of {name} in {rig_path}",
            )
        else:
            for place, what in rig.devices[name].unlike(device):
                yield file.fault(("devices", name, *place), f"{what}, as in {rig_path}")
    yield from marker_faults(scene, file, rig, rig_path)
    for name in rig.devices:
        if name not in scene.devices:
            yield file.fault(("devices",), f"does not hold the device {name}, which {rig_path} has. Add it")
