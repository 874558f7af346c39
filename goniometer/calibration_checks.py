"""Whether a recipe may use a stored calibration, and whether a calibration's recipe fits its rig and scene."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path

from acquisition.calibrated_slots import SlotCalibration
from acquisition.calibration_recipe import CalibrationRecipe, calibration_steps
from acquisition.recipe import Recipe
from acquisition.reference_light import PolarizerReference
from goniometer.collision_zones import blocked_ways
from goniometer.cross_checks import exposure_faults, filter_faults
from goniometer.planning import slots, timing
from goniometer.rig_devices.entry import AxesEntry, Role
from goniometer.rig_file import Rig
from goniometer.yaml_file import Fault, YamlFile
from sim_devices.effects.reference_polarizer import ReferencePolarizer
from sim_devices.scene import Scene

_CLOCKS_APART = timedelta(hours=1)
"""By how much the clocks of two computers may differ."""

_ARMS: tuple[Role, Role] = ("source_arm", "detector_arm")
_ANEW = "Calibrate anew with goniometer calibrate, or name another file"


def calibration_for_recipe(
    recipe: Recipe, file: YamlFile, rig: Rig, calibration: SlotCalibration, path: Path, now: datetime
) -> Iterator[Fault]:
    """Why a calibration is not for this scan, at the recipe's own lines."""

    def refused(what: str) -> Fault:
        return file.fault(("calibration",), f"{path} {what}. {_ANEW}")

    age = now - calibration.measured_at
    if recipe.calibration_max_age_days is not None and age > timedelta(days=recipe.calibration_max_age_days):
        yield refused(
            f"was measured {age.total_seconds() / 86400:.1f} days ago, on {calibration.measured}; allowed: at most "
            f"{recipe.calibration_max_age_days:g} (calibration_max_age_days)"
        )
    if age < -_CLOCKS_APART:
        yield refused(f"was measured on {calibration.measured}, which is still to come: look at this computer's clock")
    if calibration.wavelength_nm != (wavelength_nm := recipe.one_wavelength_nm):
        yield refused(
            f"holds at {calibration.wavelength_nm:g} nm; this recipe measures at {wavelength_nm:g} nm, and what "
            "polarizers do depends on it"
        )
    if calibration.rig != rig.rig:
        yield refused(f"is of the bench '{calibration.rig}'; this recipe's is '{rig.rig}'")
    elif (calibration.analyzer, calibration.devices) != (analyzer_name(rig), drivers(rig)):
        yield refused(
            f"was measured with other devices, {_listed(calibration.devices)}; the rig file has {_listed(drivers(rig))}"
        )
    elif calibration.layout != rig.analyzer.contents() or calibration.offset_deg != rig.analyzer.offset_deg:
        yield refused(
            f"is of slots with {_listed(calibration.layout)} (offset_deg {calibration.offset_deg:g}); those of the rig "
            f"file hold {_listed(rig.analyzer.contents())} (offset_deg {rig.analyzer.offset_deg:g})"
        )


def zeros_for_recipe(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path, now: datetime) -> Iterator[Fault]:
    """Which arms were aligned longer ago than a recipe allows, at the recipe's own lines."""
    if recipe.calibration_max_age_days is None:
        return
    measured = {role: text for role in _ARMS if (text := rig.axes()[role].zero_measured) is not None}
    if recipe.calibration is None and not measured:
        yield file.fault(
            ("calibration_max_age_days",),
            f"has nothing to be about: the recipe names no calibration, and in {rig_path} no arm has zero_measured",
        )
    for role, text in measured.items():
        age = now - datetime.fromisoformat(text)
        if age > timedelta(days=recipe.calibration_max_age_days) or age < -_CLOCKS_APART:
            yield file.fault(
                ("calibration_max_age_days",),
                f"got {recipe.calibration_max_age_days:g}, but the zero of {role} in {rig_path} was measured "
                f"{age.total_seconds() / 86400:.1f} days ago, on {text}. Align the arm anew with goniometer align, or "
                "look at this computer's clock",
            )


def calibration_recipe_on_rig(recipe: CalibrationRecipe, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Whatever the recipe of a calibration asks that its rig cannot do, at the recipe's own lines."""
    yield from exposure_faults(recipe.exposure_s, file, rig, rig_path)
    yield from filter_faults((recipe.wavelength_nm,), file, rig, rig_path)
    if rig.is_simulated and recipe.scene is None:
        yield file.fault(
            ("scene",), f"is missing, but {rig_path} is simulated. Name a scene file, or a rig of real devices"
        )
    if rig.generator is not None:
        yield file.fault(
            ("rig",),
            f"the light passes the generator of {rig_path}, and a calibration is of the lamp alone. Take the "
            "generator out of the beam, and name a rig file without it",
        )
        return
    if rig.analyzer.retarded():
        yield file.fault(
            ("rig",),
            f"the analyzer of {rig_path} has a retarder, and only polarizers can be calibrated. Measure its retardance "
            "and its angles otherwise, and state them in the rig file",
        )
        return
    if not slots(rig).polarizers:
        yield file.fault(("rig",), f"no slot of {rig_path} holds a polarizer: there is nothing to calibrate")
        return
    outside = False
    for angles in recipe.calibrate.directions():
        for role, angle in zip(_ARMS, angles, strict=True):
            low, high = rig.axes()[role].travel.reachable_deg
            if not low <= angle <= high:
                outside = True
                yield file.fault(
                    ("calibrate", "incidence_deg" if role == "source_arm" else "exit_deg"),
                    f"asks for {angle:g} degrees; allowed: {low:g} to {high:g}, the limits of {role} in {rig_path}",
                )
    travels = {role: axis.travel for role, axis in rig.axes().items()}
    steps = calibration_steps(recipe, slots(rig, recipe.wavelength_nm), timing(rig))
    if not outside and any(blocked_ways(steps, rig.zones, travels)):
        yield file.fault(
            ("calibrate",), f"leads through a collision zone of {rig_path}. Choose other angles of incidence and exit"
        )


def reference_in_scene(recipe: CalibrationRecipe, file: YamlFile, scene: Scene, scene_path: Path) -> Iterator[Fault]:
    """Whether the bench that a scene simulates has the light and the reference, at the recipe's own lines."""
    lamp_nm = scene.lamp.wavelength_nm
    if lamp_nm is not None and recipe.wavelength_nm != lamp_nm:
        yield file.fault(
            ("wavelength_nm",), f"got {recipe.wavelength_nm:g}; allowed: {lamp_nm:g}, the lamp's in {scene_path}"
        )
    has_polarizer = any(isinstance(effect, ReferencePolarizer) for effect in scene.effects)
    needs_polarizer = isinstance(recipe.calibrate, PolarizerReference)
    if has_polarizer != needs_polarizer:
        what = "does not hold" if needs_polarizer else "holds"
        remedy = "Add it to the effects" if needs_polarizer else "Take it out of the effects"
        yield file.fault(("scene",), f"{scene_path} {what} a reference_polarizer. {remedy}")


def analyzer_name(rig: Rig) -> str:
    """What the rig file calls its analyzer."""
    return next(name for name, device in rig.devices.items() if device.part == "analyzer")


def drivers(rig: Rig) -> dict[str, str]:
    """The driver of each device, but of a generator and what turns it: it does not change what an analyzer passes."""
    turned_by = set() if rig.generator is None else set(rig.generator.carried_by)
    return {
        name: device.driver
        for name, device in rig.devices.items()
        if device.part != "generator" and not (isinstance(device, AxesEntry) and device.axes.keys() <= turned_by)
    }


def _listed(pairs: object) -> str:
    assert isinstance(pairs, dict)
    return ", ".join(
        f"{name}: {value:g}" if isinstance(value, float) else f"{name}: {value}" for name, value in pairs.items()
    )
