"""What a scan will measure of an assumed sample: its readings without noise, and the covariances they reduce to.

The covariances come from `Reduction` itself, so that what is predicted is what will be reported.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.expand import Step, Target
from acquisition.fit_points import directions
from acquisition.lamp_level import LampLevel
from acquisition.readings import Reading, StokesPoint
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from model.acceptance import Acceptance
from model.geometry import FloatArray
from model.surface import Surface

Light = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""S0 to S3 (N, 4) in 1/sr for incidence, signed exit angles and exit azimuths (N,) in degrees."""


@dataclass(frozen=True)
class Detection:
    """The detector's side of a bench: what makes readings of light.

    Parameters
    ----------
    radiometry : Radiometry
        The rig's calibration.
    noise : NoiseModel
        The detector's noise.
    dark_w : float
        Power that it shows in the dark, in W; it matters by its photon noise alone.
    """

    radiometry: Radiometry
    noise: NoiseModel
    dark_w: float = 0.0

    def power_w(self, stokes: FloatArray, incidence_deg: float, exit_deg: float, analyzer: AnalyzerState) -> float:
        """Mean power of a reading of light S0 to S3 in 1/sr through an analyzer."""
        return self.dark_w + self.radiometry.arriving_w(incidence_deg, exit_deg) * float(analyzer.row() @ stokes)


def light_of(surface: Surface | Acceptance) -> Light:
    """The light of a surface, as readings need it."""

    def light(incidence_deg: FloatArray, exit_deg: FloatArray, exit_azimuth_deg: FloatArray) -> FloatArray:
        stokes = surface.stokes(*directions(incidence_deg, exit_deg, exit_azimuth_deg=exit_azimuth_deg))
        return np.asarray(stokes, np.float64)

    return light


def expected_readings(steps: Sequence[Step], light: Light, detection: Detection) -> tuple[Reading, ...]:
    """The readings that steps take of a sample when there is no noise, a steady lamp and no error of position."""
    places = [step.target for step in steps]
    stokes = light(*np.array([(there.incidence_deg, there.exit_deg, there.exit_azimuth_deg) for there in places]).T)
    readings, ended_s = [], 0.0
    for step, of_step in zip(steps, stokes, strict=True):
        target = step.target
        ended_s += step.duration_s
        power_w = detection.dark_w
        if step.kind != "dark":
            power_w = detection.power_w(of_step, target.incidence_deg, target.exit_deg, step.analyzer)
        readings += [
            Reading(
                point=step.point,
                kind=step.kind,
                repeat=repeat,
                time_s=ended_s - (step.readings - repeat) * step.reading_s,
                incidence_deg=target.incidence_deg,
                exit_deg=target.exit_deg,
                azimuth_deg=target.azimuth_deg,
                slot=target.slot,
                analyzer_deg=step.analyzer_deg,
                exposure_s=step.exposure_s,
                power_w=power_w,
                retarder_deg=step.retarder_deg,
                retardance_deg=step.retardance_deg,
                exit_azimuth_deg=target.exit_azimuth_deg,
            )
            for repeat in range(step.readings)
        ]
    return tuple(readings)


def expected_points(steps: Sequence[Step], light: Light, detection: Detection) -> tuple[StokesPoint, ...]:
    """The Stokes points, with their covariances, that steps will yield of a sample.

    Raises
    ------
    ReductionError
        If a direction cannot be reduced, for example because the reference direction is dark.
    """
    has_dark = any(step.kind == "dark" for step in steps)
    reduction = Reduction(detection.radiometry, detection.noise, has_dark=has_dark)
    return reduction.scan(expected_readings(steps, light, detection))


def expected_covariance(
    stokes: FloatArray,
    incidence_deg: float,
    exit_deg: float,
    detection: Detection,
    *,
    analyzer: Sequence[AnalyzerState],
    exposure_s: float,
    readings: int = 1,
    has_dark: bool = True,
    lamp: LampLevel = LampLevel(),  # noqa: B008 (frozen)
) -> FloatArray:
    """Covariance of S0, S1, S2 in 1/sr² of one direction, with every slot read equally often.

    It is (3, 3), or (4, 4) with S3 where an analyzer state depends on it.

    Without references it goes with 1/readings.

    Parameters
    ----------
    stokes : ndarray
        The S0 to S3 to be measured, shape (4,), in 1/sr.
    incidence_deg, exit_deg : float
        Incidence and signed exit angle, in degrees.
    detection : Detection
        The detector's side of the bench.
    analyzer : sequence of AnalyzerState
        What light is read through.
    exposure_s : float
        Of each reading, in s.
    readings : int
        In each slot.
    has_dark : bool
        Whether the blocked slot is read too.
    lamp : LampLevel
        What references tell of the lamp.
    """
    here = Target(incidence_deg, exit_deg, 0.0, 1)
    steps = [
        Step(
            *(0, "signal", here, state.polarizer_deg, readings, exposure_s, 0.0),
            *(state.retarder_deg, state.retardance_deg),
        )
        for state in analyzer
    ]
    if has_dark:
        steps.append(Step(0, "dark", here, None, readings, exposure_s, 0.0))
    taken = expected_readings(steps, lambda *_: np.broadcast_to(stokes, (len(steps), 4)), detection)
    return Reduction(detection.radiometry, detection.noise, has_dark=has_dark).point(taken, lamp).covariance
