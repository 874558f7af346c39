"""Readings of known light reduce to that light, with errors that describe the scatter."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.lamp_level import LampLevel
from acquisition.readings import Reading
from acquisition.reduce import NoiseModel, Radiometry, Reduction
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


@pytest.mark.parametrize(("incidence_deg", "exit_deg"), [(0.0, 60.0), (20.0, 0.0), (70.0, 35.0)])
def test_pixels_see_more_of_a_spot_that_is_larger_and_darker_the_more_obliquely_each_is_met(incidence_deg, exit_deg):
    """A plate that scatters evenly: every pixel sees irradiance · cos(incidence) / pi, from wherever it looks."""
    seen_w = BEAM_W * ACCEPTANCE_SR * math.cos(math.radians(incidence_deg)) / math.pi
    readings = [
        replace(reading("signal", seen_w / 2, angle_deg=angle, exit_deg=exit_deg), incidence_deg=incidence_deg)
        for angle in (0, 45, 90, 135)
    ]
    pixels = Reduction(Radiometry(BEAM_W, ACCEPTANCE_SR, sees_whole_spot=False), QUIET, has_dark=False)
    assert_allclose(pixels.point(readings, LampLevel()).stokes, [1 / math.pi, 0.0, 0.0], rtol=1e-12, atol=1e-15)


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


def test_directions_that_were_not_finished_are_left_out_and_named():
    whole = readings_of((0.3, 0.1, 0.0), point=0)
    cut = [one for point in (1, 2, 4) for one in readings_of((0.3, 0.1, 0.0), point=point)[:4]]
    points = reduction().scan(whole + cut)
    assert [point.point for point in points] == [0]
    signals = sum(one.kind == "signal" for one in cut)
    (doubt,) = reduction().doubts(whole + cut, points)
    assert doubt.startswith(f"The scan was cut off before points 1 to 2, 4 were finished; the {signals} readings there")
    assert reduction().scan(cut) == ()


def test_the_readings_of_a_direction_need_not_follow_one_another():
    """In sweeps all directions come by in one slot, then all in the next."""
    stokes = {point: (0.3 + 0.1 * point, 0.05 * point, -0.02) for point in range(4)}
    in_turn = [one for point, of_point in stokes.items() for one in readings_of(of_point, point=point)]
    swept = sorted(in_turn, key=lambda one: (one.analyzer_deg is None, one.analyzer_deg))
    points = reduction().scan(swept)
    assert [point.point for point in points] == [0, 1, 2, 3]
    for point in points:
        assert_allclose(point.stokes, stokes[point.point], rtol=1e-9, atol=1e-12)


def test_each_reading_is_seen_in_the_lamp_of_its_own_time():
    """A lamp that fades by 8 % within one direction would pass for polarization."""
    stokes, lamp = (0.31, 0.0, 0.0), lambda time_s: 1.0 - 0.08 * time_s / 100.0
    readings = [
        reading("reference", DARK_W + 4e-8 * lamp(time_s), point=point, time_s=time_s)
        for point, time_s in ((0, 0.0), (1, 100.0))
    ]
    for number, angle_deg in enumerate((0, 45, 90, 135)):
        time_s = 10.0 + 25.0 * number
        power_w = power_behind(stokes, angle_deg, 37.0, lamp(time_s))
        readings.append(reading("signal", power_w, angle_deg=angle_deg, time_s=time_s))
    readings += [reading("dark", DARK_W, point=point, time_s=99.0) for point in (0, 1)]
    (point,) = reduction().scan(readings)
    assert_allclose(point.stokes, stokes, atol=1e-12)
    (without,) = reduction().scan([one for one in readings if one.kind != "reference"])
    assert without.dolp > 0.02, "the case must be one where it matters"


def test_the_covariance_describes_the_scatter_by_noisy_references_of_readings_far_apart():
    stokes, times_s = (0.31, -0.12, 0.07), (5.0, 35.0, 65.0, 95.0)
    rng, points = np.random.default_rng(31), []
    noise_w = 1.2e-9
    noise = NoiseModel(read_w=noise_w, sample_s=EXPOSURE_S, shot=False, wavelength_nm=550)
    signals = [
        replace(reading("signal", power_behind(stokes, a, 37.0, 1.0), angle_deg=a, time_s=t), exposure_s=1e6)
        for a, t in zip((0, 45, 90, 135), times_s, strict=True)
    ]
    for _ in range(1500):
        references = [
            reading("reference", 4e-8 + noise_w * rng.standard_normal(), point=point, time_s=time_s)
            for point, time_s in ((0, 0.0), (1, 100.0))
        ]
        quiet = Reduction(Radiometry(BEAM_W, ACCEPTANCE_SR), noise, has_dark=False)
        lit = [replace(one, power_w=one.power_w - DARK_W) for one in signals]
        points.append(quiet.point(lit, quiet.lamp_level(references)))
    root = np.linalg.cholesky(np.mean([point.covariance for point in points], axis=0) + 1e-14 * np.eye(3))
    scatter = np.cov([point.stokes for point in points], rowvar=False)
    expected = root @ root.T
    assert_allclose(np.diag(scatter), np.diag(expected), rtol=0.15)
    assert_allclose(scatter[0, 1], expected[0, 1], rtol=0.2)


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
            (level,), ((variance,),) = LampLevel(times_s, tuple(rng.normal(true_w, stderr_w)), (stderr_w**2,) * 3).at(
                [time_s]
            )
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


# S3


PLATE_DEG = (-51.7, -15.1, 15.1, 51.7)


def power_behind_plate(stokes, retarder_deg, analyzer_deg, retardance_deg, exit_deg=37.0):
    """The reading by Mueller matrices written out: rotation, retarder (fast axis along x), rotation, polarizer."""
    c, s = (f(math.radians(2 * retarder_deg)) for f in (math.cos, math.sin))
    turn = np.array([[1, 0, 0, 0], [0, c, s, 0], [0, -s, c, 0], [0, 0, 0, 1]])
    cd, sd = (f(math.radians(retardance_deg)) for f in (math.cos, math.sin))
    plate = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, cd, sd], [0, 0, -sd, cd]])
    ca, sa = (f(math.radians(2 * analyzer_deg)) for f in (math.cos, math.sin))
    passed = 0.5 * np.array([1, ca, sa, 0]) @ turn.T @ plate @ turn @ stokes
    return DARK_W + BEAM_W * ACCEPTANCE_SR * math.cos(math.radians(exit_deg)) * passed


def readings_behind_plate(stokes, true_retardance_deg=90.0, retarders_deg=PLATE_DEG, analyzer_deg=20.0, **place):
    taken = [
        replace(
            reading("signal", power_behind_plate(stokes, angle, analyzer_deg, true_retardance_deg), **place),
            analyzer_deg=analyzer_deg,
            retarder_deg=angle,
            retardance_deg=90.0,
            repeat=i,
        )
        for angle in retarders_deg
        for i in range(2)
    ]
    return [*taken, reading("dark", DARK_W, **place)]


def test_a_plate_that_turns_gives_all_four_back():
    stokes = np.array([0.31, -0.12, 0.07, 0.15])
    point = reduction().point(readings_behind_plate(stokes), LampLevel())
    assert point.has_s3
    assert_allclose(point.stokes, stokes, rtol=1e-12)
    assert point.covariance.shape == (4, 4)
    assert_allclose(point.docp, 0.15 / 0.31, rtol=1e-12)
    assert_allclose(point.dop, math.sqrt(0.12**2 + 0.07**2 + 0.15**2) / 0.31, rtol=1e-12)
    assert_allclose(point.dolp, math.hypot(0.12, 0.07) / 0.31, rtol=1e-12)


def test_polarizers_alone_say_nothing_of_s3():
    point = reduction().point(readings_of((0.31, -0.12, 0.07)), LampLevel())
    assert point.stokes.shape == (3,)
    assert (point.has_s3, point.docp, point.dop, point.docp_stderr, point.dop_stderr) == (False, *[None] * 4)


def test_one_state_that_depends_on_s3_makes_four_unknown():
    """Three polarizers and a circular one: without S3 as unknown, circular light would pass for something else."""
    stokes = np.array([0.31, -0.12, 0.07, 0.15])
    circular = [taken for taken in readings_behind_plate(stokes, retarders_deg=(65.0,)) if taken.kind == "signal"]
    readings = [*readings_of(stokes[:3], (0, 60, 120)), *circular]
    assert_allclose(reduction().point(readings, LampLevel()).stokes, stokes, rtol=1e-12)
    short = [*readings_of(stokes[:3], (0, 90)), *circular]
    with pytest.raises(ReductionError, match=r"Point 0 cannot be reduced.* at least 4 different"):
        reduction().point(short, LampLevel())


@pytest.mark.parametrize("taken", range(1, 10))
def test_a_scan_with_s3_cut_anywhere_in_a_point_has_s3_in_every_point(taken):
    stokes = np.array([0.31, -0.12, 0.07, 0.15])
    linear = [one for one in readings_of(stokes[:3], point=1) if one.kind == "signal"]
    whole = readings_behind_plate(stokes, point=0)
    points = reduction().scan([*whole, reading("dark", DARK_W, point=1), *linear[: taken - 1]])
    assert [point.stokes.shape for point in points] == [(4,)]


def test_errors_of_s3_docp_and_dop_describe_their_scatter():
    noise = NoiseModel(read_w=3e-10, sample_s=0.003, shot=True, wavelength_nm=550)
    stokes = np.array([0.03, -0.006, 0.007, 0.009])
    clean = readings_behind_plate(stokes)
    mean_w = np.array([taken.power_w for taken in clean])
    rng, points = np.random.default_rng(23), []
    for _ in range(400):
        drawn = rng.normal(mean_w, np.sqrt(noise.variance(mean_w, np.full_like(mean_w, EXPOSURE_S))))
        noisy = [replace(taken, power_w=float(power)) for taken, power in zip(clean, drawn, strict=True)]
        points.append(reduction(noise).point(noisy, LampLevel()))
    scatter = np.array([point.stokes for point in points]) - stokes
    chi_square = sum(s @ np.linalg.solve(p.covariance, s) for s, p in zip(scatter, points, strict=True))
    assert abs(chi_square - 4 * len(points)) < 4 * math.sqrt(2 * 4 * len(points))
    for name, true_value in (("docp", 0.3), ("dop", float(np.linalg.norm(stokes[1:])) / 0.03)):
        pulls = [(getattr(p, name) - true_value) / getattr(p, f"{name}_stderr") for p in points]
        assert abs(np.mean(pulls)) < 0.2
        assert 0.9 < np.std(pulls) < 1.1


def test_a_retardance_that_is_off_shrinks_s3_and_mixes_linear_light():
    """With the fixed polarizer at psi, light S1' along it and S2' at 45 degrees from it, read behind a plate at beta:

    P = ½ [S0 + S1' (c² + s² cos d) + S2' c s (1 - cos d) - S3 s sin d], c = cos 2(beta - psi), s = sin 2(beta - psi).
    So for d = 90 + e degrees taken for 90, S3 comes out sin d = cos e times as large, S2' 1 - cos d = 1 + sin e times,
    S1' likewise, and S0 by -S1' sin e too large, whatever the plate's angles.
    """
    e = math.radians(3.0)
    s0, along, across, s3 = 0.3, 0.1, 0.05, 0.12
    stokes = np.array([s0, along, across, s3])
    readings = readings_behind_plate(stokes, true_retardance_deg=93.0, analyzer_deg=0.0)
    got = reduction().point(readings, LampLevel()).stokes
    grown = 1 + math.sin(e)
    assert_allclose(got, [s0 - along * math.sin(e), along * grown, across * grown, s3 * math.cos(e)], rtol=1e-12)


# The lamp


def lit(point, lamp, *, before=(), behind=(), noise_w=0.0, seed=0):
    """A direction at 10 s a point in a lamp of this level, with references of these levels 4 s before and behind it."""
    rng = np.random.default_rng([seed, point])
    time_s = 10.0 * point

    def reference(level, at_s, repeat):
        power_w = DARK_W + 4e-8 * level + noise_w * rng.standard_normal()
        return reading("reference", power_w, point=point, time_s=at_s, repeat=repeat)

    signals = [
        reading("signal", power_behind((0.31, -0.12, 0.07), a, 37.0, lamp), angle_deg=a, point=point, time_s=time_s)
        for a in (0, 45, 90, 135)
    ]
    return [
        *(reference(level, time_s - 4.0, i) for i, level in enumerate(before)),
        *signals,
        reading("dark", DARK_W, point=point, time_s=time_s + 1.0),
        *(reference(level, time_s + 4.0, i) for i, level in enumerate(behind)),
    ]


def test_a_reference_behind_the_last_direction_counts_by_itself():
    """The last direction has one before it, too: with both in one mean, a drift would go unseen."""
    readings = [*lit(0, 1.0, before=(1.0, 1.0)), *lit(1, 0.95, before=(0.97, 0.97), behind=(0.93, 0.93))]
    lamp = reduction().lamp_level(readings)
    assert lamp.times_s == (-4.0, 6.0, 14.0)
    assert_allclose(lamp.powers_w, 4e-8 * np.array([1.0, 0.97, 0.93]), rtol=1e-9)
    assert_allclose(reduction().scan(readings)[1].stokes, (0.31, -0.12, 0.07), rtol=1e-9)
    assert reduction().doubts(readings, reduction().scan(readings)) == ()


def test_a_lamp_that_went_off_takes_the_directions_since_the_last_good_reference_with_it():
    readings = [
        *lit(0, 1.0, before=(1.0,)),
        *lit(1, 1.0),
        *lit(2, 1.0, before=(1.0,)),
        *lit(3, 0.0),
        *lit(4, 0.0, behind=(0.0,)),
    ]
    points = reduction().scan(readings)
    assert [point.point for point in points] == [0, 1]
    (doubt,) = reduction().doubts(readings, points)
    assert doubt.startswith("At points 2 to 4 (12 readings) the lamp level cannot be followed: ")
    assert "at 16.0 s and 44.0 s on the bench's clock" in doubt
    assert "one shows no light: the lamp may have been off" in doubt
    with pytest.raises(ReductionError, match=r"points 2 to 4 \(12 readings\).*left out of every result"):
        reduction().require_lamp(reduction().lamp_level(readings), readings)


def test_a_lamp_that_was_off_between_good_references_of_both_sides_takes_those_alone():
    """A dark reference in the middle: the stretches on both its sides are in doubt, and no others."""
    readings = [
        *lit(0, 1.0, before=(1.0,)),
        *lit(1, 1.0, before=(0.0,)),
        *lit(2, 1.0, before=(1.0,)),
        *lit(3, 1.0, before=(1.0,), behind=(1.0,)),
    ]
    points = reduction().scan(readings)
    assert [point.point for point in points] == [2, 3]
    assert len(reduction().doubts(readings, points)) == 2


def test_behind_a_dark_reference_everything_is_dark_until_the_next():
    """As in a scan that has ended at that reference, with the direction behind it already read."""
    readings = [*lit(0, 1.0, before=(1.0,)), *lit(1, 1.0, before=(1.0,)), *lit(2, 0.0, before=(0.0,))]
    points = reduction().scan(readings)
    assert [point.point for point in points] == [0]
    assert reduction().doubts(readings, points)[0].startswith("At points 1 to 2 (8 readings) ")


@pytest.mark.parametrize(("change", "is_seen"), [(0.08, False), (0.12, True), (-0.08, False), (-0.12, True)])
def test_a_change_of_the_lamp_beyond_the_limit_is_told_with_both_levels(change, is_seen):
    readings = lit(0, 1.0, before=(1.0,), behind=(1.0 / (1 - change) if change > 0 else 1 + change,))
    lamp = reduction().lamp_level(readings)
    if is_seen:
        with pytest.raises(
            ReductionError, match=r"lamp levels of 1 and (1.14|0.88).* more than 0.1 \(largest_change\)"
        ):
            reduction().require_lamp(lamp, readings)
        with pytest.raises(ReductionError, match="largest_change"):
            reduction().scan(readings)
    else:
        reduction().require_lamp(lamp, readings)
        assert len(reduction().scan(readings)) == 1


def test_a_recipe_may_allow_its_lamp_more():
    readings = lit(0, 0.75, before=(1.0,), behind=(0.5,))
    tolerant = Reduction(Radiometry(BEAM_W, ACCEPTANCE_SR), QUIET, has_dark=True, largest_change=0.6)
    (point,) = tolerant.scan(readings)
    assert_allclose(point.stokes, (0.31, -0.12, 0.07), rtol=1e-9)


def test_noise_alone_is_no_change_of_the_lamp():
    """References with an error of 6 %, a steady lamp: no alarm among a thousand, though many differ by 10 %."""
    noise = NoiseModel(read_w=2.4e-9, sample_s=EXPOSURE_S, shot=False, wavelength_nm=550)
    readings = [taken for point in range(1000) for taken in lit(point, 1.0, before=(1.0,), noise_w=2.4e-9, seed=4)]
    lamp = reduction(noise).lamp_level(readings)
    assert np.mean(np.abs(np.diff(lamp.powers_w)) > 0.1 * 4e-8) > 0.1, "the case must lie where noise makes such steps"
    reduction(noise).require_lamp(lamp, readings)


def test_a_reference_that_noise_may_have_made_shows_no_light():
    noise = NoiseModel(read_w=1e-9, sample_s=EXPOSURE_S, shot=False, wavelength_nm=550)
    stderr = math.sqrt(2) * 1e-9 / 4e-8  # of a reference less its dark reading, in units of the lamp
    for level, is_dark in ((4.0 * stderr, True), (6.0 * stderr, False)):
        readings = lit(0, 1.0, before=(level,), behind=(level,))
        if is_dark:
            with pytest.raises(
                ReductionError, match=r"first reference reading shows no light \(.* ± 1.4e-09 W above dark"
            ):
                reduction(noise).lamp_level(readings)
        else:
            reduction(noise).require_lamp(reduction(noise).lamp_level(readings), readings)


def test_directions_behind_the_last_reference_are_kept_and_named():
    """As in a scan that was cut short; the references of finished scans stand at both ends."""
    readings = [*lit(0, 1.0, before=(1.0,)), *lit(1, 1.0), *lit(2, 1.0)]
    points = reduction().scan(readings)
    assert len(points) == 3
    assert reduction().doubts(readings, points) == (
        "No reference was read after points 0 to 2: the lamp is taken to be as bright there as at the last one, -4.0 s "
        "on the bench's clock",
    )
    without = [taken for taken in readings if taken.kind != "reference"]
    assert reduction().doubts(without, reduction().scan(without)) == ()


def test_a_scan_without_any_light_says_so():
    noise = NoiseModel(read_w=1e-9, sample_s=EXPOSURE_S, shot=False, wavelength_nm=550)
    rng = np.random.default_rng(6)

    def scan_of(s0):
        return [
            replace(taken, power_w=taken.power_w + 1e-9 * rng.standard_normal())
            for point in range(30)
            for taken in readings_of((s0, 0.0, 0.0), point=point)
        ]

    dark, dim = scan_of(0.0), [*scan_of(0.0), *readings_of((0.02, 0.0, 0.0), point=30)]
    (doubt,) = reduction(noise).doubts(dark, reduction(noise).scan(dark))
    assert doubt.startswith("No light was seen: S0 is within 5 standard errors of 0 in every direction.")
    assert reduction(noise).doubts(dim, reduction(noise).scan(dim)) == ()
