"""The recipe of a calibration: which reference is measured with which bench, and for how long."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from pydantic import AfterValidator, Field

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.expand import HOME, Slots, Step, Target
from acquisition.moving import Moving
from acquisition.readings import ReadingKind
from acquisition.recipe import MAX_READINGS, check_printable
from acquisition.reference_light import AnyReference, ReferenceLight
from acquisition.section import Section
from acquisition.timing import BenchTiming

if TYPE_CHECKING:
    _Reference = ReferenceLight
else:
    _Reference = AnyReference


class CalibrationRecipe(Section):
    """A scan of all slots of the analyzer before light whose polarization is known."""

    recipe: Annotated[str, AfterValidator(check_printable)] = Field(
        min_length=1, max_length=200, description="name of the calibration, for a person"
    )
    rig: str = Field(min_length=1, description="rig file; a relative path starts at this file's folder")
    scene: str | None = Field(
        default=None,
        min_length=1,
        description="scene file that a simulated rig holds; a relative path starts at this file's folder; "
        "not used on real devices",
    )
    wavelength_nm: float = Field(ge=200, le=2500, description="wavelength of the light, in nm")
    calibrate: _Reference = Field(description="the reference, and what is known of it")
    readings: int = Field(
        ge=1, le=MAX_READINGS, description="number of readings in every slot on the way through the slots, and back"
    )
    exposure_s: float = Field(gt=0, le=3600, description="duration of one reading, in s")


def calibration_steps(recipe: CalibrationRecipe, slots: Slots, timing: BenchTiming) -> tuple[Step, ...]:
    """The steps of one scan: at every direction through all slots and back, so that a lamp's even drift averages out.

    The first direction is point 0. An open slot counts as a signal behind no polarizer.
    """
    steps: list[Step] = []
    reading_s, moving_s = timing.reading_s(recipe.exposure_s), Moving(timing)
    for point, (incidence_deg, exit_deg) in enumerate(recipe.calibrate.directions()):
        stops = tuple(_stops(slots))
        for slot, kind, state in (*stops, *stops[::-1]):
            here = steps[-1].target if steps else HOME
            there = Target(incidence_deg, exit_deg, 0.0, slot, filter_slot=slots.filter_slot)
            duration_s = moving_s(here, there) + timing.readings_s(recipe.readings, recipe.exposure_s)
            steps.append(
                Step(
                    *(point, kind, there, state.polarizer_deg, recipe.readings, recipe.exposure_s, duration_s),
                    reading_s=reading_s,
                )
            )
    return tuple(steps)


def _stops(slots: Slots) -> Iterator[tuple[int, ReadingKind, AnalyzerState]]:
    kinds: dict[int, tuple[ReadingKind, AnalyzerState]] = {
        slot: ("signal", AnalyzerState(angle + slots.offset_deg)) for angle, slot in slots.polarizers.items()
    }
    if slots.open is not None:
        kinds[slots.open] = "signal", AnalyzerState()
    if slots.blocked is not None:
        kinds[slots.blocked] = "dark", AnalyzerState()
    for slot in sorted(kinds):
        yield slot, *kinds[slot]
