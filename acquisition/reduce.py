"""From readings to Stokes parameters: weighted least squares of the analyzer matrix, with covariance.

A reading of power P behind a polarizer at angle psi, in the direction (incidence, exit), is

    P = dark + beam_power · acceptance · cos(exit) · lamp · ½ [S0 + S1 cos 2psi + S2 sin 2psi]

with S in 1/sr. S0, S1, S2 and the dark power of a direction are solved for together, so that the noise of the dark
readings is carried into the covariance. `lamp` is the reference readings' ratio to their first, 1 without any.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from acquisition.analyzer_matrix import analyzer_row, check_analyzer_set
from acquisition.readings import Reading, StokesPoint
from goniometer.errors import ReductionError

_PLANCK_J_S = 6.62607015e-34
_LIGHT_SPEED_M_S = 299792458.0
_UNKNOWN_AOLP_STDERR_DEG = 180.0 / math.sqrt(12.0)
"""Standard deviation of an angle that may be anything within 180 degrees."""


@dataclass(frozen=True)
class NoiseModel:
    """Variance of a reading: read noise that averages down, and the photons' own.

    Parameters
    ----------
    read_w : float
        Standard deviation of one sample, in W.
    sample_s : float
        Duration of one sample, in s.
    shot : bool
        Whether photon noise counts.
    wavelength_nm : float
        Sets the energy of a photon.
    """

    read_w: float
    sample_s: float
    shot: bool
    wavelength_nm: float

    def variance(self, power_w: NDArray[np.float64], exposure_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance in W² of readings of mean `power_w` over `exposure_s`."""
        read = self.read_w**2 * self.sample_s / exposure_s
        if not self.shot:
            return read
        photon_j = _PLANCK_J_S * _LIGHT_SPEED_M_S / (self.wavelength_nm * 1e-9)
        return np.asarray(read + photon_j * np.maximum(power_w, 0.0) / exposure_s)


@dataclass(frozen=True)
class Radiometry:
    """What turns power into 1/sr: the beam's power in W and the detector's acceptance in sr."""

    beam_power_w: float
    acceptance_sr: float


@dataclass(frozen=True)
class LampLevel:
    """The lamp's level against the first reference reading, between references linear in time.

    `times_s`, `powers_w` and `variances_w2` have one entry for each group of reference readings; empty: no reference.
    """

    times_s: tuple[float, ...] = ()
    powers_w: tuple[float, ...] = ()
    variances_w2: tuple[float, ...] = ()

    def at(self, time_s: float) -> tuple[float, float]:
        """Level and its variance at a time; held constant before the first and after the last reference."""
        if not self.times_s:
            return 1.0, 0.0
        shares = np.array([np.interp(time_s, self.times_s, unit) for unit in np.eye(len(self.times_s))])
        first_w = self.powers_w[0]
        level = float(shares @ self.powers_w) / first_w
        slopes = shares / first_w
        slopes[0] -= level / first_w  # the first reference is in the denominator too
        return level, float(slopes**2 @ self.variances_w2)


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
    """

    def __init__(self, radiometry: Radiometry, noise: NoiseModel, *, has_dark: bool) -> None:
        self._radiometry, self._noise, self._has_dark = radiometry, noise, has_dark

    def scan(self, readings: Sequence[Reading]) -> tuple[StokesPoint, ...]:
        """Reduce every direction whose readings determine its Stokes parameters; readings of a cut-off last one wait.

        Raises
        ------
        ReductionError
            When a direction other than the last cannot be reduced.
        """
        lamp = self.lamp_level(readings)
        groups = [list(group) for _, group in groupby(readings, key=lambda reading: reading.point)]
        points = [self.point(group, lamp) for group in groups[:-1]]
        if groups and self.can_reduce(groups[-1]):
            points.append(self.point(groups[-1], lamp))
        return tuple(points)

    def can_reduce(self, readings: Sequence[Reading]) -> bool:
        """Whether the readings of a direction determine its Stokes parameters."""
        try:
            self._refuse_undetermined(readings)
        except ReductionError:
            return False
        return True

    def _refuse_undetermined(self, readings: Sequence[Reading]) -> None:
        angles_deg = list({reading.analyzer_deg: None for reading in readings if reading.kind == "signal"})
        try:
            check_analyzer_set(angles_deg)
        except ReductionError as error:
            raise ReductionError(f"Point {readings[0].point} cannot be reduced: {error}") from None
        if self._has_dark and not any(reading.kind == "dark" for reading in readings):
            raise ReductionError(f"Point {readings[0].point} cannot be reduced: its dark reading is missing.")

    def lamp_level(self, readings: Sequence[Reading]) -> LampLevel:
        """The lamp's level over the scan from its reference readings, dark subtracted where it is measured."""
        times_s, powers_w, variances = [], [], []
        for group in _reference_groups(readings):
            power_w, variance = self._mean(group)
            if self._has_dark:
                darks = [r for r in readings if r.kind == "dark" and r.point == group[0].point]
                if not darks:  # a scan cut off between the two
                    continue
                dark_w, dark_variance = self._mean(darks)
                power_w, variance = power_w - dark_w, variance + dark_variance
            if power_w <= 0.0:
                raise ReductionError(
                    f"The reference reading at point {group[0].point} shows no light ({power_w:g} W above dark): the "
                    "lamp level cannot be followed. Choose a brighter reference exit angle, or leave the reference out."
                )
            times_s.append(sum(r.time_s for r in group) / len(group))
            powers_w.append(power_w)
            variances.append(variance)
        return LampLevel(tuple(times_s), tuple(powers_w), tuple(variances))

    def point(self, readings: Sequence[Reading], lamp: LampLevel) -> StokesPoint:
        """Reduce the readings of one direction.

        Raises
        ------
        ReductionError
            When they do not determine S0, S1 and S2.
        """
        kinds = ("signal", "dark") if self._has_dark else ("signal",)
        readings = [reading for reading in readings if reading.kind in kinds]
        signals = [reading for reading in readings if reading.kind == "signal"]
        self._refuse_undetermined(readings)
        exit_deg = float(np.mean([reading.exit_deg for reading in signals]))
        level, level_variance = lamp.at(float(np.mean([reading.time_s for reading in signals])))
        scale_w = (
            self._radiometry.beam_power_w * self._radiometry.acceptance_sr * math.cos(math.radians(exit_deg)) * level
        )
        matrix = _design_matrix(readings, self._has_dark)
        power_w = np.array([reading.power_w for reading in readings])
        exposure_s = np.array([reading.exposure_s for reading in readings])
        solution, covariance = _solve(matrix, power_w, lambda mean_w: self._noise.variance(mean_w, exposure_s))
        stokes = solution[:3] / scale_w
        covariance = covariance[:3, :3] / scale_w**2 + np.outer(stokes, stokes) * level_variance / level**2
        return _stokes_point(signals[0], stokes, covariance)

    def _mean(self, readings: Sequence[Reading]) -> tuple[float, float]:
        power_w = np.array([reading.power_w for reading in readings])
        exposure_s = np.array([reading.exposure_s for reading in readings])
        variance = self._noise.variance(np.full_like(power_w, power_w.mean()), exposure_s)
        return float(power_w.mean()), float(variance.sum() / len(readings) ** 2)


def _reference_groups(readings: Sequence[Reading]) -> Iterator[list[Reading]]:
    references = [reading for reading in readings if reading.kind == "reference"]
    for _, group in groupby(references, key=lambda reading: reading.point):
        yield list(group)


def _design_matrix(readings: Sequence[Reading], has_dark: bool) -> NDArray[np.float64]:
    rows = np.zeros((len(readings), 4 if has_dark else 3))
    for row, reading in zip(rows, readings, strict=True):
        if reading.kind == "signal":
            row[:3] = analyzer_row(reading.analyzer_deg)
    if has_dark:
        rows[:, 3] = 1.0
    return rows


def _solve(
    matrix: NDArray[np.float64],
    power_w: NDArray[np.float64],
    variance_of: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted least squares, weighted by the variance of the fitted, not of the measured, powers.

    Weights from the measured powers would favour readings that came out low by chance and so bias the result.
    """
    fitted_w = matrix @ np.linalg.lstsq(matrix, power_w, rcond=None)[0]
    stderr_w = np.sqrt(variance_of(fitted_w))
    whitened = matrix / stderr_w[:, None]
    q, r = np.linalg.qr(whitened)
    solution = np.linalg.solve(r, q.T @ (power_w / stderr_w))
    inverse = np.linalg.inv(r)
    return solution, inverse @ inverse.T


def _stokes_point(reading: Reading, stokes: NDArray[np.float64], covariance: NDArray[np.float64]) -> StokesPoint:
    """Add degree and angle of linear polarization with first-order errors.

    The debiased degree is the modified asymptotic estimator of Plaszczynski et al. (2014): it never goes negative and
    tends to p - b²/(2p) for a clear signal, where b² is the variance across the polarization's direction.
    """
    s0, s1, s2 = stokes
    polarized = math.hypot(s1, s2)
    dolp = debiased = dolp_stderr = math.nan
    aolp_stderr_deg = _UNKNOWN_AOLP_STDERR_DEG
    if s0 > 0.0:
        dolp = polarized / s0
        along = np.array([s1, s2]) / polarized if polarized > 0.0 else np.array([1.0, 0.0])
        across = np.array([-along[1], along[0]])
        to_ratios = np.array([[-s1 / s0, 1.0, 0.0], [-s2 / s0, 0.0, 1.0]]) / s0
        ratio_covariance = to_ratios @ covariance @ to_ratios.T
        dolp_stderr = math.sqrt(along @ ratio_covariance @ along)
        bias_variance = float(across @ ratio_covariance @ across)
        debiased = dolp
        if dolp > 0.0:
            debiased += bias_variance * math.expm1(-(dolp**2) / bias_variance) / (2.0 * dolp)
            aolp_stderr_deg = min(aolp_stderr_deg, math.degrees(math.sqrt(bias_variance) / (2.0 * dolp)))
    return StokesPoint(
        point=reading.point,
        incidence_deg=reading.incidence_deg,
        exit_deg=reading.exit_deg,
        azimuth_deg=reading.azimuth_deg,
        stokes=stokes,
        covariance=covariance,
        dolp=dolp,
        dolp_debiased=debiased,
        dolp_stderr=dolp_stderr,
        aolp_deg=math.degrees(0.5 * math.atan2(s2 + 0.0, s1)),  # -0.0 would turn 90 degrees into -90
        aolp_stderr_deg=aolp_stderr_deg,
    )
