"""What follows from a recipe and a rig before any device is opened: the steps, and how readings will be reduced."""

from __future__ import annotations

from acquisition.expand import Slots, Step, expand
from acquisition.recipe import Recipe
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from acquisition.timing import AnalyzerTiming, AxisTiming, BenchTiming
from goniometer.rig_file import AxisEntry, Rig


def plan(recipe: Recipe, rig: Rig) -> tuple[Step, ...]:
    """The steps of a recipe on a rig, with their durations."""
    return expand(recipe, slots(rig), timing(rig))


def slots(rig: Rig) -> Slots:
    """What the rig's analyzer holds in which slot."""
    held = rig.analyzer.slots
    return Slots(
        polarizers={float(content): slot for slot, content in held.items() if not isinstance(content, str)},
        offset_deg=rig.analyzer.offset_deg,
        blocked=next((slot for slot, content in held.items() if content == "blocked"), None),
        open=next((slot for slot, content in held.items() if content == "open"), None),
    )


def timing(rig: Rig) -> BenchTiming:
    """The speeds that the rig file states."""

    def of(axis: AxisEntry) -> AxisTiming:
        return AxisTiming(axis.velocity_deg_s, axis.acceleration_deg_s2, axis.settle_s)

    axes = rig.axes()
    analyzer = rig.analyzer
    return BenchTiming(
        source_arm=of(axes["source_arm"]),
        detector_arm=of(axes["detector_arm"]),
        sample_azimuth=of(axes["sample_azimuth"]),
        analyzer=AnalyzerTiming(len(analyzer.slots), analyzer.slot_s, analyzer.settle_s),
    )


def reduction(recipe: Recipe, rig: Rig) -> Reduction:
    """The reduction that the rig's calibration and its detector's noise ask for."""
    detector = rig.detector
    return Reduction(
        Radiometry(rig.calibration.beam_power_w, rig.calibration.acceptance_sr),
        NoiseModel(detector.noise.read_w, detector.sample_s, detector.noise.shot, recipe.wavelength_nm),
        has_dark=recipe.dark,
    )
