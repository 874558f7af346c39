"""What is predicted of readings is what becomes of them: powers, covariances, lamp references."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.expand import Slots, expand
from acquisition.expected_noise import Detection, expected_covariance, expected_points, expected_readings
from acquisition.recipe import Recipe
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from acquisition.timing import AxisTiming, BenchTiming, DetectorTiming, WheelTiming

SLOTS = Slots(polarizers={0.0: 2, 45.0: 3, 90.0: 4, 135.0: 5}, offset_deg=10.0, blocked=6, open=1)
ARM = AxisTiming(velocity_deg_s=20, acceleration_deg_s2=80, settle_s=0.05)
TIMING = BenchTiming(ARM, ARM, ARM, WheelTiming(slots=6, slot_s=0.5, settle_s=0.05))
DETECTION = Detection(Radiometry(1e-4, 1e-4), NoiseModel(2e-11, 0.003, shot=True, wavelength_nm=550.0), dark_w=2e-10)
STOKES = np.array([0.3, 0.12, -0.05, 0.08])
SETTING = {"analyzer": [AnalyzerState(angle) for angle in (10.0, 55.0, 100.0, 145.0)], "exposure_s": 0.03}


def light(incidence_deg, exit_deg, exit_azimuth_deg=0.0):
    return np.outer(1.0 + exit_deg / 60.0, STOKES)


RECIPE = {
    "recipe": "x",
    "rig": "rig.yaml",
    "wavelength_nm": 550.0,
    "incidence_deg": 60.0,
    "exit_deg": [0.0, 20.0, 40.0],
    "analyzer_deg": [0.0, 45.0, 90.0, 135.0],
    "readings": [2, 3, 5],
    "exposure_s": 0.03,
    "fit": {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}},
}


def steps_of(**changes):
    return expand(Recipe.model_validate({**RECIPE, **changes}), SLOTS, TIMING)


REFERENCE = {"exit_deg": 30.0, "every_points": 2}


@pytest.mark.parametrize("changes", [{}, {"dark": False}, {"reference": REFERENCE}])
def test_expected_readings_reduce_to_the_light_that_they_are_of(changes):
    detection = DETECTION if changes.get("dark", True) else replace(DETECTION, dark_w=0.0)
    for point in expected_points(steps_of(**changes), light, detection):
        assert_allclose(point.stokes, light(60.0, np.array([point.exit_deg]))[0, :3], rtol=1e-9)


def test_readings_follow_each_other_within_their_steps():
    steps = steps_of(reference=REFERENCE)
    readings = expected_readings(steps, light, DETECTION)
    times_s = [reading.time_s for reading in readings]
    assert len(readings) == sum(step.readings for step in steps)
    assert (np.diff(times_s) >= 0.03).all()
    assert 0.0 < times_s[0] < times_s[-1] < sum(step.duration_s for step in steps)


def test_the_covariance_of_a_direction_is_that_of_the_scan():
    for point, readings in zip(expected_points(steps_of(), light, DETECTION), (2, 3, 5), strict=True):
        stokes = light(60.0, np.array([point.exit_deg]))[0]
        alone = expected_covariance(stokes, 60.0, point.exit_deg, DETECTION, readings=readings, **SETTING)
        assert_allclose(alone, point.covariance, rtol=1e-9, atol=1e-18)


def test_readings_of_a_slow_detector_are_as_far_apart_as_they_take():
    """A lock-in waits for its filter before each reading."""
    slow = replace(TIMING, detector=DetectorTiming(overhead_s=0.7))
    steps = expand(Recipe.model_validate(RECIPE | {"reference": REFERENCE}), SLOTS, slow)
    readings = expected_readings(steps, light, DETECTION)
    begun_s = 0.0
    for step in steps:
        of_step, readings = readings[: step.readings], readings[step.readings :]
        begun_s += step.duration_s
        times_s = np.array([reading.time_s for reading in of_step])
        assert_allclose(np.diff(times_s), 0.73)
        assert_allclose(begun_s - times_s[-1], 0.73)


RETARDED = Slots(
    polarizers={},
    offset_deg=10.0,
    blocked=6,
    open=1,
    retarded={slot: AnalyzerState(0.0, angle, 90.0) for slot, angle in enumerate((-51.7, -15.1, 15.1, 51.7), 2)},
)


def test_light_behind_a_retarder_reduces_to_all_four_with_the_predicted_covariance():
    """Read noise alone is added here, whose least-squares covariance is variance·(AᵀA)⁻¹ for the rows A."""
    settings = {"analyzer_deg": [0.0] * 4, "retarder_deg": [-51.7, -15.1, 15.1, 51.7]}
    steps = expand(Recipe.model_validate(RECIPE | settings | {"dark": False, "readings": 1}), RETARDED, TIMING)
    assert {(step.analyzer_deg, step.retarder_deg) for step in steps} >= {(10.0, -41.7), (10.0, 61.7)}
    detection = Detection(Radiometry(1e-4, 1e-4), NoiseModel(2e-11, 0.003, shot=False, wavelength_nm=550.0))
    for point in expected_points(steps, light, detection):
        assert_allclose(point.stokes, light(60.0, np.array([point.exit_deg]))[0], rtol=1e-9)
        rows = np.array([step.analyzer.row() for step in steps if step.point == point.point])
        scale = 1e-8 * np.cos(np.radians(point.exit_deg))
        variance = (2e-11 / scale) ** 2 * 0.003 / 0.03
        assert_allclose(point.covariance, variance * np.linalg.inv(rows.T @ rows), rtol=1e-9, atol=1e-15)


def test_the_covariance_goes_with_readings_and_exposure():
    once = expected_covariance(STOKES, 60.0, 20.0, DETECTION, **SETTING)
    assert_allclose(
        expected_covariance(STOKES, 60.0, 20.0, DETECTION, readings=7, **SETTING), once / 7.0, rtol=1e-9, atol=1e-18
    )
    longer = expected_covariance(STOKES, 60.0, 20.0, DETECTION, **{**SETTING, "exposure_s": 0.21})
    assert_allclose(longer, once / 7.0, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("has_dark", [True, False])
def test_the_covariance_is_the_scatter_of_noisy_readings(has_dark):
    """Photons are counted and read noise is added here, without the noise model; photons matter at this power."""
    bright = Detection(Radiometry(1e-4, 1e-4), NoiseModel(2e-14, 0.003, True, 550.0), 2e-12 * has_dark)
    (direction,) = (steps_of(exit_deg=[20.0], readings=4, dark=has_dark),)
    readings = expected_readings(direction, light, bright)
    random = np.random.default_rng(3)
    reduction = Reduction(bright.radiometry, bright.noise, has_dark=has_dark)
    photon_w = 6.62607015e-34 * 299792458.0 / 550e-9 / 0.03

    def noisy(reading):
        counted_w = random.poisson(reading.power_w / photon_w) * photon_w
        return replace(reading, power_w=counted_w + random.normal(0.0, 2e-14 * np.sqrt(0.1)))

    scattered = [reduction.scan([noisy(reading) for reading in readings])[0].stokes for _ in range(1500)]
    stokes = light(60.0, np.array([20.0]))[0]
    expected = expected_covariance(stokes, 60.0, 20.0, bright, readings=4, has_dark=has_dark, **SETTING)
    root = np.linalg.inv(np.linalg.cholesky(expected))
    assert_allclose(root @ np.cov(scattered, rowvar=False) @ root.T, np.eye(3), atol=0.15)


def test_references_add_the_lamps_uncertainty():
    """It grows with the distance from the first reference, with which all others are compared."""
    plain = expected_points(steps_of(readings=3, direction_within_s=0), light, DETECTION)
    followed = expected_points(steps_of(readings=3, reference=REFERENCE, direction_within_s=0), light, DETECTION)
    relative = []
    for without, with_reference in zip(plain, followed, strict=True):
        added = with_reference.covariance - without.covariance
        assert np.linalg.eigvalsh(added).min() >= -1e-9 * added[0, 0]
        relative.append(added[0, 0] / without.stokes[0] ** 2)
    assert 0.0 < relative[0] < relative[1] < relative[2]
