"""Readings of known light give the analyzer back that made them, with errors that describe the scatter, or nothing."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.calibration_problem import CalibrationScan
from acquisition.detector_noise import NoiseModel
from acquisition.readings import Reading
from acquisition.reference_light import PlateReference, PolarizerReference
from acquisition.solve_calibration import solve_calibration
from goniometer.errors import ReductionError

NOISE = NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=550)
EXPOSURE_S, DARK_W = 0.03, 2e-10
NOMINAL_DEG = {2: 0.0, 3: 45.0, 4: 90.0, 5: 135.0}
TRUE = {2: (0.8, 0.005, 0.9), 3: (44.0, 0.004, 0.98), 4: (90.5, 0.006, 0.93), 5: (135.9, 0.005, 1.0)}
ANGLES_DEG = (0.0, 30.0, 60.0, 90.0, 120.0, 150.0)


def polarizer(angles_deg=ANGLES_DEG, zero=0.05, setting=0.02):
    return PolarizerReference(
        reference="polarizer",
        angles_deg=angles_deg,
        zero_stderr_deg=zero,
        setting_stderr_deg=setting,
        extinction_ratio=1e6,
        incidence_deg=60.0,
        exit_deg=60.0,
    )


def plate(n=1.52, k=0.0, n_stderr=0.001):
    return PlateReference(
        reference="plate", incidence_deg=(40.0, 56.66, 70.0), n=n, n_stderr=n_stderr, k=k, incidence_stderr_deg=0.02
    )


def between(one_deg, slot, leak=0.0):
    """Share of light polarized at an angle that a slot passes: Malus along its axis, and its leak across."""
    angle_deg, slot_leak, transmission = TRUE[slot]
    cos_squared = math.cos(math.radians(angle_deg - one_deg)) ** 2
    return transmission * (cos_squared + slot_leak * (1 - cos_squared))


def reading(slot, kind, power_w, rng, point=0, repeat=0, half_deg=60.0):
    noise_w = 0.0 if rng is None else rng.normal() * math.sqrt(NOISE.variance(np.array(power_w), np.array(EXPOSURE_S)))
    angle_deg = NOMINAL_DEG.get(slot)
    return Reading(
        point, kind, repeat, 0.0, half_deg, half_deg, 0.0, slot, angle_deg, EXPOSURE_S, float(power_w + noise_w)
    )


def through_slots(share_of_slot, power_w, rng, readings, has_open=True, **place):
    slots = {slot: share_of_slot(slot) for slot in TRUE} | ({1: 1.0} if has_open else {})
    for repeat in range(readings):
        for slot, share in slots.items():
            yield reading(slot, "signal", DARK_W + power_w * share, rng, repeat=repeat, **place)
        yield reading(6, "dark", DARK_W, rng, repeat=repeat, **place)


def polarizer_scans(rng=None, readings=3, errors_deg=None, power_w=5e-9, has_open=True, sense=1.0, **reference):
    """Behind a reference that turns, with another power at each angle: light before it is polarized, lamps drift."""
    known = polarizer(**reference)
    scans = []
    for number, angle_deg in enumerate(known.angles_deg):
        true_deg = sense * angle_deg + (0.0 if errors_deg is None else errors_deg[number])
        of_state_w = power_w * (1.0 + 0.4 * math.cos(math.radians(2 * true_deg - 10.0)))
        taken = through_slots(lambda slot, at=true_deg: between(at, slot), of_state_w, rng, readings, has_open)
        scans.append(CalibrationScan(f"scan {number}", known, angle_deg, tuple(taken)))
    return scans


def fresnel(incidence_deg, n):
    """Reflectances of s and p for a dielectric, from the angles of incidence and refraction."""
    one = math.radians(incidence_deg)
    other = math.asin(math.sin(one) / n)
    return (math.sin(one - other) / math.sin(one + other)) ** 2, (math.tan(one - other) / math.tan(one + other)) ** 2


def plate_scan(rng=None, readings=3, n=1.52):
    taken = []
    for point, incidence_deg in enumerate(plate().incidence_deg):
        s, p = fresnel(incidence_deg, n)

        def share(slot, s=s, p=p):
            return (s * between(0.0, slot) + p * between(90.0, slot)) / (s + p)

        taken += through_slots(share, 5e-8 * (s + p), rng, readings, point=point, half_deg=incidence_deg)
    return CalibrationScan("plate", plate(), None, tuple(taken))


def truth():
    return np.array(list(TRUE.values()))


def test_readings_without_noise_give_the_slots_back():
    found = solve_calibration(polarizer_scans(), NOISE)
    assert found.slots == (2, 3, 4, 5)
    assert_allclose(found.values, truth(), atol=3e-5)  # of the reference's own leak of 1e-6
    assert_allclose(found.dark_w[0], DARK_W, rtol=1e-3)
    assert found.chi_square < 1.0


def test_without_an_open_slot_transmissions_are_relative_to_the_first_polarizer():
    found = solve_calibration(polarizer_scans(has_open=False), NOISE)
    assert found.relative_to_slot == 2
    relative = truth() / [1.0, 1.0, TRUE[2][2]]
    assert_allclose(found.values, relative, atol=3e-5)
    assert found.covariance[2, 2] == 0.0


def test_the_errors_describe_the_scatter_also_that_of_the_reference():
    """Zero and settings are drawn anew each time, from what the recipe says of them."""
    rng = np.random.default_rng(3)
    chi_square, count = 0.0, 60
    for _ in range(count):
        errors_deg = rng.normal(0.0, 0.05) + rng.normal(0.0, 0.02, len(ANGLES_DEG))
        found = solve_calibration(polarizer_scans(rng, 5, errors_deg), NOISE)
        off = (found.values - truth()).ravel()
        chi_square += off @ np.linalg.solve(found.covariance, off)
    expected = 12 * count
    assert abs(chi_square - expected) < 4 * math.sqrt(2 * expected)


def test_a_zero_that_is_off_turns_all_slots_alike_and_the_other_way():
    found = solve_calibration(polarizer_scans(errors_deg=[0.1] * 6, power_w=5e-7), NOISE)
    assert_allclose(found.values[:, 0], truth()[:, 0] - 0.1, atol=1e-3)
    stderr_deg = np.sqrt(np.diag(found.covariance))[0::3]
    assert (stderr_deg > 0.05).all(), "the zero's own error is in every angle"
    assert found.covariance[0, 3] / (stderr_deg[0] * stderr_deg[1]) > 0.9, "and it is one for all"


def test_a_plate_shows_where_s_is_when_the_polarizer_s_zero_is_not_known():
    scans = polarizer_scans(errors_deg=[1.3] * 6, zero=5.0)
    with pytest.raises(ReductionError, match=r"angle of slot 2 \(0 deg\) would be known to ± 5.*a glass plate"):
        solve_calibration(scans, NOISE)
    found = solve_calibration([*scans, plate_scan()], NOISE)
    assert_allclose(found.values, truth(), atol=3e-4)
    assert np.sqrt(found.covariance[0, 0]) < 0.05


def test_the_errors_of_a_plate_and_a_polarizer_together_describe_the_scatter():
    rng = np.random.default_rng(4)
    chi_square, count = 0.0, 30
    for _ in range(count):
        errors_deg = rng.normal(0.0, 5.0) * 0.2 + rng.normal(0.0, 0.02, len(ANGLES_DEG))
        found = solve_calibration(
            [*polarizer_scans(rng, 4, errors_deg, zero=1.0), plate_scan(rng, 4, rng.normal(1.52, 0.001))], NOISE
        )
        off = (found.values - truth()).ravel()
        chi_square += off @ np.linalg.solve(found.covariance, off)
    expected = 12 * count
    assert abs(chi_square - expected) < 4 * math.sqrt(2 * expected)


def test_a_lamp_that_is_less_steady_than_the_detector_enlarges_the_errors():
    rng = np.random.default_rng(5)
    quiet = solve_calibration(polarizer_scans(np.random.default_rng(6), 10), NOISE)
    scans = [
        CalibrationScan(
            scan.name,
            scan.reference,
            scan.setting_deg,
            tuple(Reading(**(vars(r) | {"power_w": r.power_w * rng.normal(1.0, 0.006)})) for r in scan.readings),
        )
        for scan in polarizer_scans(np.random.default_rng(6), 10)
    ]
    unsteady = solve_calibration(scans, NOISE)
    scatter = math.sqrt(unsteady.chi_square / unsteady.degrees_of_freedom)
    assert 2.0 < scatter < 5.0
    assert unsteady.covariance[1, 1] > 4.0 * quiet.covariance[1, 1]


@pytest.mark.parametrize(
    ("scans", "message"),
    [
        ([plate_scan()], r"cannot determine the angle of slot 2 \(0 deg\), the extinction of slot 3 \(45 deg\), the"),
        (polarizer_scans(angles_deg=(0.0, 60.0)), "cannot determine the angle of slot 2"),
        (polarizer_scans(angles_deg=(0.0, 60.0, 120.0), has_open=False), "cannot determine the angle of slot 2"),
        (polarizer_scans(angles_deg=(0.0, 2.0, 4.0, 6.0)), "would be known to ±"),
        (polarizer_scans(np.random.default_rng(1), 1, power_w=1e-10), "Take more readings|Slot . was found at"),
        (polarizer_scans(sense=-1.0), "Slot . was found at .*in which sense the reference's angles count"),
        (polarizer_scans(errors_deg=[0.0, 0.0, 5.0, 0.0, 0.0, 0.0]), "scatter about the best solution"),
        ([*polarizer_scans(), *polarizer_scans(zero=0.2)], "the reference polarizer's zero is 0 ± 0.2 here"),
    ],
    ids=["plate", "two", "three_without_open", "close", "dark", "backwards", "wrong_angle", "two_references"],
)
def test_what_scans_do_not_tell_is_refused(scans, message):
    with pytest.raises(ReductionError, match=message):
        solve_calibration(scans, NOISE)


def test_only_what_a_plate_leaves_open_is_named():
    """Of slots along s and p the angle, to first order; of those aslant leak and transmission, which go together."""
    with pytest.raises(ReductionError) as refused:
        solve_calibration([plate_scan()], NOISE)
    named = str(refused.value).partition(": ")[0].removeprefix("These scans cannot determine ").split(", ")
    assert set(named) == {
        "the angle of slot 2 (0 deg)",
        "the extinction of slot 3 (45 deg)",
        "the transmission of slot 3 (45 deg)",
        "the angle of slot 4 (90 deg)",
        "the extinction of slot 5 (135 deg)",
        "the transmission of slot 5 (135 deg)",
    }


def test_three_angles_are_enough_with_an_open_slot():
    found = solve_calibration(polarizer_scans(angles_deg=(0.0, 60.0, 120.0)), NOISE)
    assert_allclose(found.values, truth(), atol=1e-4)


def test_another_polarizer_than_the_rig_file_names_is_refused():
    moved = [
        CalibrationScan(
            scan.name,
            scan.reference,
            scan.setting_deg,
            tuple(Reading(**(vars(r) | {"analyzer_deg": 25.0})) if r.slot == 3 else r for r in scan.readings),
        )
        for scan in polarizer_scans()
    ]
    with pytest.raises(
        ReductionError, match=r"Slot 3 was found at 44.0 degrees.*the rig file says a polarizer at 25 degrees"
    ):
        solve_calibration(moved, NOISE)


@pytest.mark.parametrize(("n", "k"), [(1.52, 0.0), (2.95, 2.93)])
def test_light_of_a_plate_is_s_polarized_beyond_fresnel_doubt(n, k):
    """Independent of the code's form: r_s and r_p from Snell's law with a complex angle."""
    one = math.radians(56.0)
    other = np.arcsin(math.sin(one) / complex(n, k))
    r_s = (np.cos(one) - complex(n, k) * np.cos(other)) / (np.cos(one) + complex(n, k) * np.cos(other))
    r_p = (complex(n, k) * np.cos(one) - np.cos(other)) / (complex(n, k) * np.cos(one) + np.cos(other))
    expected = (abs(r_s) ** 2 - abs(r_p) ** 2) / (abs(r_s) ** 2 + abs(r_p) ** 2)
    light = plate(n, k).light(None, 55.0, np.array([n, k, 1.0]))
    assert_allclose(light, [1.0, expected, 0.0], rtol=1e-12)
    assert expected > 0.0


def test_light_behind_a_polarizer_lies_along_it():
    light = polarizer().light(30.0, 60.0, np.array([10.0, 5.0, 0.0, 0.0]))
    assert_allclose(light, [1.0, 0.0, 1.0], atol=3e-6)


@pytest.mark.parametrize("incoming", [(0.3, 0.0), (0.0, -0.2), (-0.1, 0.25)])
def test_a_leak_of_the_reference_turns_light_that_comes_polarized(incoming):
    """Jones: along its axis the amplitudes pass, across it their share √e; the coherency matrix gives the light."""
    leak, angle_deg = 1e-6, 25.0
    s1, s2 = incoming
    coherency = 0.5 * np.array([[1 + s1, s2], [s2, 1 - s1]])
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    turn = np.array([[cos, sin], [-sin, cos]])
    jones = turn.T @ np.diag([1.0, math.sqrt(leak)]) @ turn
    passed = jones @ coherency @ jones.T
    expected = np.array([passed.trace(), passed[0, 0] - passed[1, 1], 2 * passed[0, 1]]) / passed.trace()
    found = polarizer().light(angle_deg, 60.0, np.array([0.0, 0.0, s1, s2]))
    turned_by, found_by = (math.atan2(light[2], light[1]) - math.radians(2 * angle_deg) for light in (expected, found))
    assert abs(turned_by) > 1e-4
    assert_allclose(found_by, turned_by, rtol=0.4)  # first order in the polarization


def test_the_same_angle_twice_is_refused():
    with pytest.raises(ValueError, match="which is 0 again"):
        polarizer(angles_deg=(0.0, 60.0, 120.0, 180.0))
