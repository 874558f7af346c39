"""Readings through polarizers that are not ideal reduce to their light, and the calibration's errors go into it."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.calibrated_slots import SlotCalibration, slot_row
from acquisition.detector_noise import NoiseModel
from acquisition.lamp_level import LampLevel
from acquisition.readings import Reading
from acquisition.reduce import Radiometry, Reduction

BEAM_W, ACCEPTANCE_SR, DARK_W, EXIT_DEG = 2e-3, 5e-4, 3e-10, 37.0
QUIET = NoiseModel(read_w=1e-13, sample_s=0.003, shot=False, wavelength_nm=550)
STOKES = np.array([0.31, -0.12, 0.07])
SLOTS = {2: (0.8, 0.005, 0.9), 3: (44.0, 0.004, 0.98), 4: (90.5, 0.006, 0.93), 5: (135.9, 0.005, 1.0)}
NOMINAL_DEG = {2: 0.0, 3: 45.0, 4: 90.0, 5: 135.0}
STDERRS = (0.1, 1e-3, 2e-3)


def calibration(slots=SLOTS, stderrs=STDERRS, correlation=None, dark=None):
    named = {
        slot: {
            "holds": NOMINAL_DEG[slot],
            **dict(zip(("angle_deg", "leak", "transmission"), map(float, values), strict=True)),
            **dict(zip(("angle_stderr_deg", "leak_stderr", "transmission_stderr"), stderrs, strict=True)),
        }
        for slot, values in slots.items()
    }
    return SlotCalibration(
        calibration="test",
        measured="2026-01-31T12:00:00+00:00",
        rig="bench",
        devices={"wheel": "thorlabs_fw102c"},
        analyzer="wheel",
        offset_deg=0.0,
        layout={1: "open", 6: "blocked", **NOMINAL_DEG},
        wavelength_nm=550.0,
        reference="polarizer",
        scans=("one",),
        chi_square=10.0,
        degrees_of_freedom=9,
        relative_to_slot=1,
        slots=named,
        correlation=np.eye(12).tolist() if correlation is None else correlation.tolist(),
        dark=dark,
    )


def readings(stokes=STOKES, dark_w=DARK_W, has_dark=True):
    scale_w = BEAM_W * ACCEPTANCE_SR * math.cos(math.radians(EXIT_DEG))
    at = (0, "signal", 0, 0.0, 60.0, EXIT_DEG, 0.0)
    taken = [
        Reading(*at, slot, NOMINAL_DEG[slot], 0.03, dark_w + scale_w * float(slot_row(*values) @ stokes))
        for slot, values in SLOTS.items()
    ]
    return [*taken, Reading(0, "dark", *at[2:], 6, None, 0.03, dark_w)] if has_dark else taken


def reduction(calibrated, has_dark=True, noise=QUIET):
    return Reduction(Radiometry(BEAM_W, ACCEPTANCE_SR), noise, has_dark=has_dark, calibration=calibrated)


def test_calibrated_readings_give_the_light_back_and_others_do_not():
    assert_allclose(reduction(calibration()).point(readings(), LampLevel()).stokes, STOKES, rtol=1e-9)
    ideal = reduction(None).point(readings(), LampLevel())
    assert abs(ideal.dolp - math.hypot(0.12, 0.07) / 0.31) > 0.005


def test_the_calibration_s_errors_describe_what_they_do_to_the_light():
    """The same readings, reduced with calibrations that scatter as this one says, correlations included."""
    rng = np.random.default_rng(2)
    mixing = np.eye(12) + 0.2 * rng.normal(size=(12, 12))
    correlation = mixing @ mixing.T
    correlation /= np.sqrt(np.outer(np.diag(correlation), np.diag(correlation)))
    given = calibration(correlation=correlation)
    stated = reduction(given).point(readings(), LampLevel())
    drawn = []
    for off in rng.multivariate_normal(np.zeros(12), given.covariance, 1500):
        slots = {slot: np.array(values) + off[3 * at :][:3] for at, (slot, values) in enumerate(SLOTS.items())}
        drawn.append(reduction(calibration(slots)).point(readings(), LampLevel()))
    scatter = np.cov(np.array([point.stokes for point in drawn]).T)
    unit = np.sqrt(np.outer(np.diag(scatter), np.diag(scatter)))
    assert_allclose(stated.covariance / unit, scatter / unit, atol=0.12)
    assert_allclose(stated.dolp_stderr, np.std([point.dolp for point in drawn]), rtol=0.1)
    assert_allclose(stated.aolp_stderr_deg, np.std([point.aolp_deg for point in drawn]), rtol=0.1)


def test_errors_of_noise_and_of_the_calibration_add():
    noise = NoiseModel(read_w=3e-10, sample_s=0.003, shot=True, wavelength_nm=550)
    exact = reduction(calibration(stderrs=(0.0, 0.0, 0.0)), noise=noise).point(readings(), LampLevel())
    quiet = reduction(calibration()).point(readings(), LampLevel())
    both = reduction(calibration(), noise=noise).point(readings(), LampLevel())
    assert_allclose(both.covariance, exact.covariance + quiet.covariance, rtol=0.02, atol=1e-9)


def test_an_angle_that_all_slots_share_turns_the_light_and_leaves_dolp():
    together = np.eye(12)
    angles = range(0, 12, 3)
    together[np.ix_(angles, angles)] = 1.0
    point = reduction(calibration(stderrs=(0.1, 0.0, 0.0), correlation=together)).point(readings(), LampLevel())
    assert_allclose(point.aolp_stderr_deg, 0.1, rtol=1e-3)
    assert point.dolp_stderr < 1e-6


@pytest.mark.parametrize("stderr_w", [0.0, 2e-9])
def test_a_scan_without_dark_readings_takes_the_calibration_s(stderr_w):
    dark = {"power_w": DARK_W, "stderr_w": stderr_w}
    given = calibration(stderrs=(0.0, 0.0, 0.0), dark=dark)
    point = reduction(given, has_dark=False).point(readings(has_dark=False), LampLevel())
    assert_allclose(point.stokes, STOKES, rtol=1e-9)
    off = DARK_W + stderr_w
    moved = reduction(given, has_dark=False).point(readings(dark_w=off, has_dark=False), LampLevel()).stokes - STOKES
    assert_allclose(point.covariance, np.outer(moved, moved), rtol=1e-3, atol=1e-13)


def test_with_dark_readings_the_calibration_s_does_not_count():
    given = calibration(dark={"power_w": 1.0, "stderr_w": 1.0})
    with_it, without = (reduction(one).point(readings(), LampLevel()) for one in (given, calibration()))
    assert_allclose(with_it.stokes, without.stokes, rtol=1e-12)
    assert_allclose(with_it.covariance, without.covariance, rtol=1e-12)


def test_references_follow_the_lamp_above_the_calibration_s_dark():
    given = calibration(dark={"power_w": DARK_W, "stderr_w": 0.0})
    taken = [
        Reading(point, "reference", 0, 10.0 * point, 60.0, EXIT_DEG, 0.0, 1, None, 0.03, DARK_W + 4e-8 * level)
        for point, level in ((0, 1.0), (1, 0.95))
    ]
    lamp = reduction(given, has_dark=False).lamp_level(taken)
    assert_allclose(lamp.at([10.0])[0], 0.95, rtol=1e-12)
