"""Readings of known light reduce to that light, with errors that describe the scatter."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.readings import Reading
from acquisition.reduce import LampLevel, NoiseModel, Radiometry, Reduction
from goniometer.errors import ReductionError

BEAM_W, ACCEPTANCE_SR, DARK_W = 2e-3, 5e-4, 3e-10
QUIET = NoiseModel(read_w=1e-12, sample_s=0.003, shot=False, wavelength_nm=550)
EXPOSURE_S = 0.03


def power_behind(stokes, angle_deg, exit_deg, lamp=1.0, dark_w=DARK_W):
    """The reading written out by Malus' law: unpolarized part halved, polarized part by cos² of the angle between."""
    s0, s1, s2 = stokes
    polarized = math.hypot(s1, s2)
    direction_deg = math.degrees(0.5 * math.atan2(s2, s1))
    passed = (s0 - polarized) / 2 + polarized * math.cos(math.radians(angle_deg - direction_deg)) ** 2
    return dark_w + BEAM_W * ACCEPTANCE_SR * math.cos(math.radians(exit_deg)) * lamp * passed


def reading(kind, power_w, *, angle_deg=None, exit_deg=37.0, point=0, repeat=0, time_s=0.0):
    return Reading(point, kind, repeat, time_s, 60.0, exit_deg, 0.0, 2, angle_deg, EXPOSURE_S, power_w)


def readings_of(stokes, angles_deg=(0, 45, 90, 135), exit_deg=37.0, repeats=2, **place):
    taken = [
        reading("signal", power_behind(stokes, angle, exit_deg), angle_deg=angle, exit_deg=exit_deg, repeat=i, **place)
        for angle in angles_deg
        for i in range(repeats)
    ]
    return [*taken, reading("dark", DARK_W, exit_deg=exit_deg, **place)]


def reduction(noise=QUIET, has_dark=True):
    return Reduction(Radiometry(BEAM_W, ACCEPTANCE_SR), noise, has_dark=has_dark)


@pytest.mark.parametrize("angles_deg", [(0, 45, 90, 135), (0, 60, 120), (10, 31, 77, 101, 166), (-20, 25, 250)])
def test_any_set_of_three_or_more_angles_gives_the_light_back(angles_deg):
    stokes = (0.31, -0.12, 0.07)
    point = reduction().point(readings_of(stokes, angles_deg), LampLevel())
    assert_allclose(point.stokes, stokes, rtol=1e-12)
    assert_allclose(point.dolp, math.hypot(0.12, 0.07) / 0.31, rtol=1e-12)
    assert_allclose(point.aolp_deg, math.degrees(0.5 * math.atan2(0.07, -0.12)), rtol=1e-12)


def test_s_polarized_light_is_positive_s1_and_passes_the_polarizer_at_zero():
    along_s = [
        reading("signal", 1e-9 if a == 0 else 0.5e-9 if a in (45, 135) else 0.0, angle_deg=a) for a in (0, 45, 90, 135)
    ]
    point = reduction(has_dark=False).point(along_s, LampLevel())
    assert_allclose(point.stokes[1], point.stokes[0], rtol=1e-12)
    assert_allclose(point.aolp_deg, 0.0, atol=1e-9)


def test_two_angles_and_angles_half_a_turn_apart_are_refused():
    for angles_deg in [(0, 90), (0, 180, 45, 225)]:
        with pytest.raises(ReductionError, match=r"Point 0 cannot be reduced.*at least 3 different"):
            reduction().point(readings_of((1.0, 0.0, 0.0), angles_deg), LampLevel())


def test_a_cut_off_last_point_waits_and_an_earlier_one_is_an_error():
    whole = readings_of((0.3, 0.1, 0.0), point=0)
    cut = readings_of((0.3, 0.1, 0.0), point=1)[:4]
    assert [point.point for point in reduction().scan(whole + cut)] == [0]
    with pytest.raises(ReductionError, match="Point 1"):
        reduction().scan(whole + cut + readings_of((0.3, 0.1, 0.0), point=2))


def test_reference_readings_follow_the_lamp():
    stokes = (0.31, -0.12, 0.07)

    def at(point, time_s, lamp):
        signals = [
            reading("signal", power_behind(stokes, a, 37.0, lamp), angle_deg=a, point=point, time_s=time_s)
            for a in (0, 45, 90, 135)
        ]
        return [*signals, reading("dark", DARK_W, point=point, time_s=time_s)]

    def reference(point, time_s, lamp):
        return reading("reference", DARK_W + 4e-8 * lamp, point=point, time_s=time_s)

    readings = [
        reference(0, 0.0, 1.0),
        *at(0, 0.0, 1.0),
        *at(1, 50.0, 0.9),
        reference(2, 100.0, 0.8),
        *at(2, 100.0, 0.8),
    ]
    for point in reduction().scan(readings):
        assert_allclose(point.stokes, stokes, rtol=1e-12)
    without = [taken for taken in readings if taken.kind != "reference"]
    assert_allclose(reduction().scan(without)[2].stokes, 0.8 * np.array(stokes), rtol=1e-12)


def test_a_dark_reference_is_refused():
    readings = [reading("reference", DARK_W), *readings_of((0.3, 0.1, 0.0))]
    with pytest.raises(ReductionError, match="shows no light"):
        reduction().scan(readings)


def noisy_points(stokes, noise, seeds):
    rng = np.random.default_rng(seeds)
    points = []
    for _ in range(400):
        clean = readings_of(stokes)
        mean_w = np.array([taken.power_w for taken in clean])
        drawn = rng.normal(mean_w, np.sqrt(noise.variance(mean_w, np.full_like(mean_w, EXPOSURE_S))))
        noisy = [
            Reading(**{**taken.__dict__, "power_w": float(power)}) for taken, power in zip(clean, drawn, strict=True)
        ]
        points.append(reduction(noise).point(noisy, LampLevel()))
    return points


def test_the_covariance_describes_the_scatter():
    noise = NoiseModel(read_w=3e-10, sample_s=0.003, shot=True, wavelength_nm=550)
    stokes = (0.03, -0.012, 0.007)
    points = noisy_points(stokes, noise, 20)
    scatter = np.array([point.stokes for point in points]) - stokes
    chi_square = sum(s @ np.linalg.solve(p.covariance, s) for s, p in zip(scatter, points, strict=True))
    expected, spread = 3 * len(points), math.sqrt(2 * 3 * len(points))
    assert abs(chi_square - expected) < 4 * spread


def test_errors_of_dolp_and_aolp_describe_their_scatter():
    noise = NoiseModel(read_w=3e-10, sample_s=0.003, shot=True, wavelength_nm=550)
    stokes = (0.03, -0.012, 0.007)
    points = noisy_points(stokes, noise, 21)
    for name, true_value in (
        ("dolp", math.hypot(0.012, 0.007) / 0.03),
        ("aolp", math.degrees(0.5 * math.atan2(0.007, -0.012))),
    ):
        value, stderr = ("dolp", "dolp_stderr") if name == "dolp" else ("aolp_deg", "aolp_stderr_deg")
        pulls = [(getattr(p, value) - true_value) / getattr(p, stderr) for p in points]
        assert abs(np.mean(pulls)) < 0.2
        assert 0.9 < np.std(pulls) < 1.1


def test_debiasing_removes_most_of_the_bias_of_weakly_polarized_light():
    noise = NoiseModel(read_w=3e-10, sample_s=0.003, shot=False, wavelength_nm=550)
    stokes = (0.03, 3.5e-4, 0.0)
    points = noisy_points(stokes, noise, 22)
    truth, typical_stderr = 3.5e-4 / 0.03, np.mean([p.dolp_stderr for p in points])
    assert 2.0 < truth / typical_stderr < 4.0, "the case must lie where the bias matters"
    plain = np.mean([p.dolp for p in points]) - truth
    debiased = np.mean([p.dolp_debiased for p in points]) - truth
    assert plain > 3 * abs(debiased)
    assert all(p.dolp_debiased >= 0 for p in points)


def test_light_below_the_noise_has_no_degree_of_polarization():
    dim = [reading("signal", -1e-11, angle_deg=a) for a in (0, 45, 90, 135)]
    point = reduction(has_dark=False).point(dim, LampLevel())
    assert math.isnan(point.dolp)
    assert math.isnan(point.dolp_debiased)
    assert_allclose(point.aolp_stderr_deg, 180 / math.sqrt(12))


@pytest.mark.parametrize("taken", range(1, 10))
def test_a_scan_cut_anywhere_in_a_point_is_reduced_right_or_not_at_all(taken):
    """The dark reading comes last: without it the dark power would pass for light."""
    stokes = (0.03, -0.012, 0.007)
    points = reduction().scan(readings_of(stokes, point=0) + readings_of(stokes, point=1)[:taken])
    assert len(points) == (2 if taken == 9 else 1)
    for point in points:
        assert_allclose(point.stokes, stokes, rtol=1e-9)


def test_a_reference_that_was_cut_from_its_dark_reading_does_not_count():
    whole = [reading("reference", DARK_W + 4e-8), *readings_of((0.3, 0.1, 0.0))]
    cut = [reading("reference", DARK_W + 4e-8, point=1, time_s=9.0)]
    assert reduction().lamp_level(whole + cut).times_s == (0.0,)


def test_light_polarized_along_p_has_an_angle_of_plus_90_degrees():
    along_p = [reading("signal", {0: 0.0, 90: 1e-9}.get(a, 0.5e-9), angle_deg=a) for a in (0, 45, 90, 135)]
    assert_allclose(reduction(has_dark=False).point(along_p, LampLevel()).aolp_deg, 90.0)


def test_the_variance_of_the_lamp_level_describes_its_scatter():
    """Between references, at the first, and after the last; the first is in every ratio's denominator."""
    rng = np.random.default_rng(5)
    times_s, true_w, stderr_w = (0.0, 10.0, 20.0), np.array([4e-8, 3.5e-8, 3.8e-8]), 4e-10
    for time_s, true_level in ((0.0, 1.0), (2.5, 3.875 / 4), (10.0, 3.5 / 4), (15.0, 3.65 / 4), (30.0, 3.8 / 4)):
        levels, variances = [], []
        for _ in range(2000):
            level, variance = LampLevel(times_s, tuple(rng.normal(true_w, stderr_w)), (stderr_w**2,) * 3).at(time_s)
            levels.append(level - true_level)
            variances.append(variance)
        assert_allclose(np.mean(np.square(levels)), np.mean(variances), rtol=0.12, atol=1e-15)


def test_few_photons_do_not_bias_the_result():
    """Weights from the measured powers would favour readings that came out low."""
    photon_j = 6.62607015e-34 * 299792458.0 / 550e-9
    noise = NoiseModel(
        read_w=2 * photon_j / EXPOSURE_S * math.sqrt(EXPOSURE_S / 0.003), sample_s=0.003, shot=True, wavelength_nm=550
    )
    rng = np.random.default_rng(8)
    photons_of_s0 = BEAM_W * ACCEPTANCE_SR * math.cos(math.radians(37.0)) * EXPOSURE_S / photon_j
    s0, seen = 60.0 / photons_of_s0, []
    for _ in range(1500):
        readings = [
            reading("signal", (rng.poisson(30) + rng.normal(0, 2)) * photon_j / EXPOSURE_S, angle_deg=a, repeat=i)
            for a in (0, 45, 90, 135)
            for i in range(3)
        ]
        seen.append(reduction(noise, has_dark=False).point(readings, LampLevel()).stokes[0] / s0)
    assert abs(np.mean(seen) - 1.0) < 4 * np.std(seen) / math.sqrt(len(seen))
    assert np.std(seen) / math.sqrt(len(seen)) < 0.003
