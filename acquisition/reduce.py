"""From readings to Stokes parameters: weighted least squares of the analyzer matrix, with covariance.

A reading of power P behind an analyzer with the row a, in the direction (incidence, exit), is

    P = dark + beam_power · acceptance · cos(exit) · lamp · [a0 S0 + a1 S1 + a2 S2 + a3 S3]

with S in 1/sr; for a polarizer at psi, a = ½ [1, cos 2psi, sin 2psi, 0]. A camera, whose pixels see a part of the spot,
reads without the cosine. The Stokes parameters and the dark power of a direction are solved for together, so that the
noise of the dark readings is carried into the covariance. S3 is among them where any of the analyzer's states depends
on it, and otherwise is not spoken of. `lamp` is the reference readings' ratio to their first at the time of the
reading, 1 without any. The readings of a direction need not follow one another.

Where a generator polarizes the light on the sample, S = M g with the light's Stokes parameters g, of S0 = 1, and the
elements of M are solved for in the same way: their first column is what unpolarized light would give.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition.analyzer_matrix import analyzer_matrix
from acquisition.calibrated_slots import SlotCalibration
from acquisition.contradictions import lost_light, unsteady
from acquisition.detector_noise import NoiseModel as NoiseModel
from acquisition.doubts import behind_last_reference, in_break, in_unsteady_light, unfinished, without_light
from acquisition.generator import generator_matrix
from acquisition.lamp_level import LARGEST_CHANGE, LampBreak, LampLevel, reference_groups
from acquisition.mueller_point import reduced_point, unphysical
from acquisition.readings import Reading, StokesPoint
from acquisition.settings_matrix import Setting, check_settings, settings_matrix, settings_shape
from goniometer.errors import ReductionError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Radiometry:
    """What turns power into 1/sr: the beam's power in W and the detector's acceptance in sr.

    A detector `sees_whole_spot`, whose projected area shrinks with the cosine of the exit angle, or, as the pixels of a
    camera do, an area of its own within a larger spot: then `beam_power_w` is what falls on that area straight below at
    normal incidence, and light that comes obliquely is spread over more of the sample.
    """

    beam_power_w: float
    acceptance_sr: float
    sees_whole_spot: bool = True

    def arriving_w(self, incidence_deg: float, exit_deg: float) -> float:
        """Power that a reflectance of 1/sr sends to the detector."""
        shrunk_deg = exit_deg if self.sees_whole_spot else incidence_deg
        return self.beam_power_w * self.acceptance_sr * math.cos(math.radians(shrunk_deg))


class Reduction:
    """Reduces the readings of a scan.

    Parameters
    ----------
    radiometry : Radiometry
        The rig's calibration.
    noise : NoiseModel
        The detector's noise, from which the weights and covariances follow.
    has_dark : bool
        Whether the dark power is measured in every direction; without it, it is taken to be 0.
    largest_change : float
        Relative change of the lamp between two references beyond which nothing is made of the readings between them.
    calibration : SlotCalibration, optional
        What was found of the analyzer's slots, in place of ideal polarizers at the angles that readings name; and of
        the dark power, where it is not measured.
    suspended : sequence of LampBreak
        When the scan was suspended, and since when readings may have been spoilt: likewise.
    """

    def __init__(
        self,
        radiometry: Radiometry,
        noise: NoiseModel,
        *,
        has_dark: bool,
        largest_change: float = LARGEST_CHANGE,
        calibration: SlotCalibration | None = None,
        suspended: Sequence[LampBreak] = (),
    ) -> None:
        self._suspended = tuple(suspended)
        self._radiometry, self._noise, self._has_dark = radiometry, noise, has_dark
        self._largest_change, self._calibration = largest_change, calibration
        dark = None if calibration is None or has_dark else calibration.dark
        self._dark_w, self._dark_variance = (0.0, 0.0) if dark is None else (dark.power_w, dark.stderr_w**2)
        if calibration is not None:
            self._rows, self._row_slopes = calibration.rows(), calibration.row_slopes()

    def suspended(self, interval: LampBreak) -> Reduction:
        """The same reduction, which makes nothing of the readings of this interval either."""
        changed = copy.copy(self)
        changed._suspended = (*self._suspended, interval)
        return changed

    def is_spoilt(self, of_point: Sequence[Reading]) -> bool:
        """Whether light of a direction was read while the scan was suspended, or may have had to be."""
        return bool(self._spoiling(of_point))

    def _spoiling(self, readings: Sequence[Reading]) -> tuple[LampBreak, ...]:
        lit_s = [reading.time_s for reading in readings if reading.kind == "signal"]
        return tuple(found for found in self._suspended if any(map(found.holds, lit_s)))

    def scan(self, readings: Sequence[Reading]) -> tuple[StokesPoint, ...]:
        """Reduce every direction whose readings determine its Stokes parameters, in the order of their numbers.

        Those of a scan that was cut off before they were finished are left out, and so are those between two references
        that do not show how bright the lamp was; `doubts` names them.

        Raises
        ------
        ReductionError
            When the lamp level is known at none of the finished directions, or the first reference shows no light.
        """
        lamp = self.lamp_level(readings)
        breaks = (*lamp.breaks(self._largest_change), *self._spoiling(readings))
        whole = self._whole(readings)
        known = [
            group
            for group in whole
            if not any(found.holds(one.time_s) for one in group if one.kind == "signal" for found in breaks)
        ]
        if whole and not known:
            raise ReductionError("; ".join(in_break(found, readings) for found in breaks))
        return tuple(self.point(group, lamp) for group in known)

    def doubts(self, readings: Sequence[Reading], points: Sequence[StokesPoint]) -> tuple[str, ...]:
        """Which readings are left out, and what a person should know before believing in the points, in words."""
        breaks = self.lamp_level(readings).breaks(self._largest_change)
        whole = {group[0].point for group in self._whole(readings)}
        left_out = unfinished([one.point for one in readings if one.kind == "signal" and one.point not in whole])
        breaks = *breaks, *self._spoiling(readings)
        said = *(in_break(found, readings) for found in breaks), left_out, *self.warnings(readings, points)
        return tuple(filter(None, said))

    def warnings(self, readings: Sequence[Reading], points: Sequence[StokesPoint]) -> tuple[str, ...]:
        """What a person should know of the light of a scan before believing in its points, in words."""
        unlit = behind_last_reference(self.lamp_level(readings), readings), without_light(points)
        said = *unlit, *(in_unsteady_light(*found) for found in unsteady(points)), unphysical(points)
        return tuple(filter(None, said))

    def require_lamp(self, lamp: LampLevel, readings: Sequence[Reading]) -> None:
        """Refuse readings that were taken while nobody knows how bright the lamp was.

        Raises
        ------
        ReductionError
            Names the readings.
        """
        if breaks := lamp.breaks(self._largest_change):
            raise ReductionError("; ".join(in_break(found, readings) for found in breaks))

    def _whole(self, readings: Sequence[Reading]) -> list[list[Reading]]:
        """The readings of each direction that determine as many elements as those of the whole scan."""
        groups: dict[int, list[Reading]] = {}
        for reading in readings:
            groups.setdefault(reading.point, []).append(reading)
        shape = settings_shape(_settings(readings))
        return [group for _, group in sorted(groups.items()) if self._determines(group, shape)]

    def _determines(self, of_point: Sequence[Reading], shape: tuple[int, int]) -> bool:
        try:
            self._refuse_undetermined(of_point)
        except ReductionError:
            return False
        return settings_shape(_settings(of_point)) == shape

    def _refuse_undetermined(self, readings: Sequence[Reading]) -> None:
        try:
            check_settings(_settings(readings))
        except ReductionError as error:
            raise ReductionError(f"Point {readings[0].point} cannot be reduced: {error}") from None
        if self._has_dark and not any(reading.kind == "dark" for reading in readings):
            raise ReductionError(f"Point {readings[0].point} cannot be reduced: its dark reading is missing.")

    def lamp_level(self, readings: Sequence[Reading]) -> LampLevel:
        """The lamp's level over the scan from its reference readings, dark subtracted where it is measured."""
        times_s, powers_w, variances = [], [], []
        darks: dict[int, list[Reading]] = {}
        for reading in readings:
            if reading.kind == "dark":
                darks.setdefault(reading.point, []).append(reading)
        for group in reference_groups(readings):
            power_w, variance = self._mean(group)
            if self._has_dark:
                if group[0].point not in darks:  # a scan cut off between the two
                    continue
                dark_w, dark_variance = self._mean(darks[group[0].point])
                power_w, variance = power_w - dark_w, variance + dark_variance
            else:
                power_w, variance = power_w - self._dark_w, variance + self._dark_variance
            times_s.append(sum(r.time_s for r in group) / len(group))
            powers_w.append(power_w)
            variances.append(variance)
        lamp = LampLevel(tuple(times_s), tuple(powers_w), tuple(variances))
        if times_s and lamp.is_dark(0):
            raise ReductionError(
                f"The first reference reading shows no light ({powers_w[0]:.3g} ± {math.sqrt(variances[0]):.2g} W "
                "above dark): the lamp level cannot be followed. Look whether the lamp is on. If it is, choose "
                "a brighter reference exit angle, or leave the reference out."
            )
        return lamp

    def point(self, readings: Sequence[Reading], lamp: LampLevel) -> StokesPoint:
        """Reduce the readings of one direction.

        Raises
        ------
        ReductionError
            When they do not determine the elements that they depend on.
        """
        kinds = ("signal", "dark") if self._has_dark else ("signal",)
        readings = [reading for reading in readings if reading.kind in kinds]
        signals = [reading for reading in readings if reading.kind == "signal"]
        self._refuse_undetermined(readings)
        incidence_deg = float(np.mean([reading.incidence_deg for reading in signals]))
        exit_deg = float(np.mean([reading.exit_deg for reading in signals]))
        levels, of_levels = lamp.at([reading.time_s for reading in signals])
        scale_w = self._radiometry.arriving_w(incidence_deg, exit_deg)
        lit = np.array([reading.kind == "signal" for reading in readings])
        rows, columns, matrix = self._design_matrix(readings)
        count = rows * columns
        matrix[lit, :count] *= levels[:, None]
        power_w = np.array([reading.power_w for reading in readings]) - self._dark_w
        exposure_s = np.array([reading.exposure_s for reading in readings])

        def variance_w2(power_w: Floats) -> Floats:
            return self._noise.variance(power_w + self._dark_w, exposure_s)

        inverse, covariance = _inverted(matrix, power_w, variance_w2)
        solution = inverse @ power_w
        covariance = covariance + self._of_calibration(
            signals, levels, inverse, lit, solution[:count].reshape(rows, columns)
        )
        by_levels = inverse[:count, lit] * (matrix[lit, :count] @ solution[:count] / levels)
        elements = solution[:count] / scale_w
        covariance = (covariance[:count, :count] + by_levels @ of_levels @ by_levels.T) / scale_w**2
        is_contradictory = lost_light(matrix, count, lit, power_w, variance_w2(power_w))
        point = reduced_point(signals[0], elements, covariance, (rows, columns))
        return replace(point, is_contradictory=is_contradictory)

    def _design_matrix(self, readings: Sequence[Reading]) -> tuple[int, int, Floats]:
        """How many rows and columns of elements there are, and how these and the dark power make the readings."""
        signals = np.array([reading.kind == "signal" for reading in readings])
        of_states = analyzer_matrix([reading.analyzer for reading in readings if reading.kind == "signal"])
        if self._calibration is not None:
            of_states = np.array([self._rows[reading.slot] for reading in readings if reading.kind == "signal"])
        of_light = generator_matrix([reading.generator for reading in readings if reading.kind == "signal"])
        elements = settings_matrix(of_states, of_light)
        count = elements.shape[1]
        matrix = np.zeros((len(readings), count + self._has_dark))
        matrix[signals, :count] = elements
        matrix[:, count:] = 1.0
        return of_states.shape[1], of_light.shape[1], matrix

    def _of_calibration(
        self, signals: Sequence[Reading], levels: Floats, inverse: Floats, lit: NDArray[np.bool_], elements: Floats
    ) -> Floats:
        """What the calibration's errors add to the covariance of a solution in W², by the propagation above."""
        if self._calibration is None:
            return np.zeros((len(inverse), len(inverse)))
        arriving = generator_matrix([one.generator for one in signals]) @ elements.T
        slopes = np.array([self._row_slopes[one.slot] for one in signals])
        powers = levels[:, None] * np.einsum("nps,ns->np", slopes, arriving)
        by_slots, by_dark = inverse[:, lit] @ powers, inverse.sum(axis=1)
        of_slots = by_slots @ self._calibration.covariance @ by_slots.T
        return np.asarray(of_slots + np.outer(by_dark, by_dark) * self._dark_variance)

    def _mean(self, readings: Sequence[Reading]) -> tuple[float, float]:
        power_w = np.array([reading.power_w for reading in readings])
        exposure_s = np.array([reading.exposure_s for reading in readings])
        variance = self._noise.variance(np.full_like(power_w, power_w.mean()), exposure_s)
        return float(power_w.mean()), float(variance.sum() / len(readings) ** 2)


def _settings(readings: Sequence[Reading]) -> list[Setting]:
    """The states of analyzer and generator in which light was read, each pair once."""
    return list({(reading.analyzer, reading.generator): None for reading in readings if reading.kind == "signal"})


def _inverted(matrix: Floats, power_w: Floats, variance_of: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """What solves for the unknowns by least squares, (unknowns, readings), and the covariance of the solution.

    It is weighted by the variance of the fitted, not of the measured, powers: weights from the measured ones would
    favour readings that came out low by chance and so bias the result.
    """
    fitted_w = matrix @ np.linalg.lstsq(matrix, power_w, rcond=None)[0]
    stderr_w = np.sqrt(variance_of(fitted_w))
    q, r = np.linalg.qr(matrix / stderr_w[:, None])
    inverse = np.linalg.inv(r)
    return inverse @ (q / stderr_w[:, None]).T, inverse @ inverse.T
