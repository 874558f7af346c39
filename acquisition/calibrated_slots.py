"""What a calibration says of an analyzer's slots: each polarizer's angle, leak and transmission, with their errors.

A slot that passes the share t of the light along its axis and e·t of that across, with its axis at psi from the
s-direction, has the row ½ t [1 + e, (1 - e) cos 2psi, (1 - e) sin 2psi]: the first row of a diattenuator's Mueller
matrix, which docs/calibration.md derives. 1/e is the extinction ratio.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from acquisition.measured_time import time_fault
from acquisition.section import Section, SectionFault, refuse_all

PARAMETERS = ("angle_deg", "leak", "transmission")
"""What is known of a slot, in the order of a calibration's correlations."""

_ROUNDING = 1e-4
"""By how much a matrix of rounded correlations may miss being one."""

Stderr = Annotated[float, Field(ge=0, le=1e3)]


def slot_row(angle_deg: float, leak: float, transmission: float) -> NDArray[np.float64]:
    """The row (3,) whose product with S0, S1, S2 is what passes a slot; see the module's docstring."""
    twice = np.radians(2.0 * angle_deg)
    ideal = np.array([1.0, np.cos(twice), np.sin(twice)])
    return np.asarray(0.5 * transmission * (ideal + leak * np.array([1.0, -1.0, -1.0]) * ideal))


def slot_row_slopes(angle_deg: float, leak: float, transmission: float) -> NDArray[np.float64]:
    """Derivatives (3, 3) of `slot_row`: one row for each of `PARAMETERS`, per degree for the angle."""
    twice = np.radians(2.0 * angle_deg)
    cos, sin = np.cos(twice), np.sin(twice)
    turned = np.radians(2.0) * (1.0 - leak) * np.array([0.0, -sin, cos])
    return np.array(
        [
            0.5 * transmission * turned,
            0.5 * transmission * np.array([1.0, -cos, -sin]),
            slot_row(angle_deg, leak, 1.0),
        ]
    )


class CalibratedSlot(Section):
    """A slot with a polarizer."""

    holds: float = Field(description="the polarizer's angle as the rig file names it, in degrees")
    angle_deg: float = Field(ge=-720, le=720, description="its angle from the s-direction, in degrees")
    angle_stderr_deg: Stderr = Field(description="standard error of the angle, in degrees")
    leak: float = Field(ge=-1, lt=1, description="what passes across its axis over what passes along it")
    leak_stderr: Stderr = Field(description="standard error of the leak")
    transmission: float = Field(gt=0, le=100, description="what passes along its axis, relative to relative_to_slot")
    transmission_stderr: Stderr = Field(description="standard error of the transmission")

    @property
    def values(self) -> tuple[float, float, float]:
        """Angle, leak and transmission."""
        return self.angle_deg, self.leak, self.transmission

    @property
    def stderrs(self) -> tuple[float, float, float]:
        """Their standard errors."""
        return self.angle_stderr_deg, self.leak_stderr, self.transmission_stderr


class CalibratedDark(Section):
    """What the detector showed behind the blocked slot."""

    power_w: float = Field(description="power, in W")
    stderr_w: float = Field(ge=0, description="its standard error, in W")


class SlotCalibration(Section):
    """A stored calibration: what was found, for which bench and wavelength, when, and out of which scans."""

    calibration: str = Field(min_length=1, description="name of the calibration, for a person")
    measured: str = Field(description="when its oldest scan began, in ISO 8601 with the time zone, in quotes")
    rig: str = Field(min_length=1, description="name of the bench")
    devices: dict[str, str] = Field(description="driver of each device of the bench, by its name in the rig file")
    analyzer: str = Field(min_length=1, description="name of the analyzer among the devices")
    offset_deg: float = Field(description="offset_deg of the analyzer in the rig file, in degrees")
    layout: dict[int, float | Literal["open", "blocked"]] = Field(description="what the rig file says each slot holds")
    wavelength_nm: float = Field(gt=0, description="wavelength of the light, in nm")
    reference: str = Field(min_length=1, description="what was measured, in words")
    scans: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        min_length=1, description="the runs' folders and the hashes of their recipes"
    )
    chi_square: float = Field(ge=0, description="of the readings and of what was known of the references")
    degrees_of_freedom: int = Field(gt=0, description="readings less what was solved for")
    relative_to_slot: int = Field(description="the slot whose transmission is 1: the open one, where there is one")
    dark: CalibratedDark | None = Field(default=None, description="the dark power, where a slot is blocked")
    slots: dict[int, CalibratedSlot] = Field(min_length=1, description="what was found of each slot with a polarizer")
    correlation: Annotated[
        tuple[Annotated[tuple[float, ...], Field(strict=False)], ...], Field(strict=False, min_length=3)
    ] = Field(description="correlations of angle_deg, leak, transmission of the first slot, then of the next, ...")

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(self._faults())
        return self

    def _faults(self) -> Iterator[SectionFault]:
        if fault := time_fault(self.measured):
            yield ("measured",), fault
        held = {slot: holds for slot, holds in self.layout.items() if not isinstance(holds, str)}
        if {slot: of_slot.holds for slot, of_slot in self.slots.items()} != held:
            yield ("slots",), "are not the slots of layout that hold polarizers; calibrate the analyzer anew"
        wanted = len(PARAMETERS) * len(self.slots)
        if [len(row) for row in self.correlation] != [wanted] * wanted:
            yield ("correlation",), f"is not {wanted} rows of {wanted} numbers, {len(PARAMETERS)} for each of the slots"
            return
        matrix = np.array(self.correlation)
        is_one = np.abs(matrix - matrix.T).max() <= _ROUNDING and np.abs(np.diag(matrix) - 1.0).max() <= _ROUNDING
        if not is_one or np.linalg.eigvalsh(matrix).min() < -_ROUNDING * wanted:
            yield ("correlation",), "is no matrix of correlations: it was changed; calibrate the analyzer anew"

    @property
    def measured_at(self) -> datetime:
        """When its oldest scan began, with the time zone."""
        return datetime.fromisoformat(self.measured)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance (3K, 3K) of angle in degrees, leak and transmission of the K slots, in the order of `slots`."""
        stderrs = np.array([stderr for slot in self.slots.values() for stderr in slot.stderrs])
        return np.asarray(np.array(self.correlation) * np.outer(stderrs, stderrs))

    def rows(self) -> Mapping[int, NDArray[np.float64]]:
        """The row (3,) of each slot with a polarizer."""
        return {slot: slot_row(*found.values) for slot, found in self.slots.items()}

    def row_slopes(self) -> Mapping[int, NDArray[np.float64]]:
        """Derivatives (3K, 3) of each slot's row by everything that `covariance` is about."""
        slopes = {}
        for number, (slot, found) in enumerate(self.slots.items()):
            slopes[slot] = np.zeros((len(PARAMETERS) * len(self.slots), 3))
            slopes[slot][len(PARAMETERS) * number :][: len(PARAMETERS)] = slot_row_slopes(*found.values)
        return slopes
