"""Readings of a known Mueller matrix reduce to it, with errors that describe the scatter."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.calibrated_slots import SlotCalibration
from acquisition.generator import GeneratorState
from acquisition.lamp_level import LampLevel
from acquisition.mueller_point import lowest_eigenvalue, unphysical
from acquisition.readings import MuellerPoint, Reading
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from goniometer.errors import ReductionError
from model.lobes import Diffuse, Specular
from model.mueller import polarizer, retarder
from model.surface import Surface

BEAM_W, ACCEPTANCE_SR, DARK_W, EXIT_DEG = 2e-3, 5e-4, 3e-10, 37.0
SCALE_W = BEAM_W * ACCEPTANCE_SR * math.cos(math.radians(EXIT_DEG))
QUIET = NoiseModel(read_w=1e-13, sample_s=0.003, shot=False, wavelength_nm=550)
PLAIN = [(angle, None) for angle in (0.0, 45.0, 90.0, 135.0)]
PLATES = [(0.0, angle) for angle in (-51.7, -15.1, 15.1, 51.7, 80.0)]
RETARDANCE_DEG = 83.0
IRON = Surface([Specular(0.7, 0.1764, 2.950 + 2.932j), Diffuse(0.1, 0.1764)])
TRUE = IRON.mueller(math.radians(60), math.radians(EXIT_DEG), math.pi) + 0.01 * np.arange(16).reshape(4, 4)
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


def element(setting, *, before):
    """The matrices of polarizer and retarder in the order in which the light meets them."""
    angle_deg, plate_deg = setting
    matrix = polarizer(math.radians(angle_deg))
    if plate_deg is None:
        return matrix
    plate = retarder(math.radians(RETARDANCE_DEG), math.radians(plate_deg))
    return plate @ matrix if before else matrix @ plate


def readings_of(mueller, of_generator, of_analyzer, *, dark=True, lamp=lambda time_s: 1.0, repeats=1):
    taken = []
    for made, seen, repeat in itertools.product(of_generator, of_analyzer, range(repeats)):
        light = 2.0 * (element(made, before=True) @ [1.0, 0.0, 0.0, 0.0])
        time_s = float(len(taken))
        power_w = DARK_W * dark + SCALE_W * lamp(time_s) * (element(seen, before=False) @ mueller @ light)[0]
        retarders = [(plate, None if plate is None else RETARDANCE_DEG) for _, plate in (seen, made)]
        taken.append(
            Reading(
                *(0, "signal", repeat, time_s, 60.0, EXIT_DEG, 0.0, 2, seen[0], 0.03, power_w, *retarders[0]),
                *(None, 1, made[0], *retarders[1]),
            )
        )
    dark_one = Reading(
        0, "dark", 0, float(len(taken)), 60.0, EXIT_DEG, 0.0, 6, None, 0.03, DARK_W, None, None, None, 1, 0.0
    )
    return [*taken, dark_one] if dark else taken


def reduction(noise=QUIET, **more):
    return Reduction(Radiometry(BEAM_W, ACCEPTANCE_SR), noise, **{"has_dark": True, **more})


@pytest.mark.parametrize(("made", "columns"), [(PLAIN, 3), (PLATES, 4)])
@pytest.mark.parametrize(("seen", "rows"), [(PLAIN, 3), (PLATES, 4)])
def test_every_element_that_the_settings_tell_comes_back(made, columns, seen, rows):
    point = reduction().point(readings_of(TRUE, made, seen), LampLevel())
    assert isinstance(point, MuellerPoint)
    assert point.mueller.shape == (rows, columns)
    assert_allclose(point.mueller, TRUE[:rows, :columns], rtol=0, atol=1e-12)
    assert_allclose(point.stokes, TRUE[:rows, 0], atol=1e-12)
    first = np.arange(rows) * columns
    assert_allclose(point.covariance, point.mueller_covariance[np.ix_(first, first)])


def test_the_covariance_of_all_sixteen_describes_their_scatter():
    """Photon noise, so that the weights differ from reading to reading; and few dark readings that all share."""
    noise = NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=550)
    clean = readings_of(TRUE, PLATES, PLATES)
    stderr_w = np.sqrt(noise.variance(np.array([one.power_w for one in clean]), np.full(len(clean), 0.03)))
    random = np.random.default_rng(3)
    chi_square = []
    for _ in range(300):
        powers = [one.power_w + error for one, error in zip(clean, random.normal(0.0, stderr_w), strict=True)]
        taken = [replace(one, power_w=power) for one, power in zip(clean, powers, strict=True)]
        point = reduction(noise).point(taken, LampLevel())
        pull = np.linalg.solve(np.linalg.cholesky(point.mueller_covariance), (point.mueller - TRUE).ravel())
        chi_square.append(pull @ pull)
    assert abs(np.mean(chi_square) - 16.0) < 4 * math.sqrt(2 * 16 / 300)


def test_a_lamp_that_fades_is_followed_by_its_references():
    def lamp(time_s):
        return 1.0 - 0.002 * time_s

    taken = readings_of(TRUE, PLATES, PLATES, lamp=lamp, dark=False)
    references = [
        replace(taken[0], kind="reference", time_s=time_s, analyzer_deg=None, power_w=1e-7 * lamp(time_s))
        for time_s in (0.0, 30.0)
    ]
    (point,) = reduction(has_dark=False).scan([*taken, *references])
    assert_allclose(point.mueller, TRUE, atol=1e-9)
    steady = reduction(has_dark=False).scan(taken)[0]
    assert np.abs(steady.mueller - TRUE).max() > 1e-3


def test_a_calibration_of_the_analyzer_is_applied_and_its_errors_carried_on():
    """Against a linear propagation by differences: each slot's angle, leak and transmission changed a little."""
    made = [GeneratorState(angle) for angle in (0.0, 45.0, 90.0, 135.0)]

    def readings(slots):
        found = calibration(slots=slots).rows()
        return [
            Reading(
                *(0, "signal", 0, 0.0, 60.0, EXIT_DEG, 0.0, slot, 0.0, 0.03),
                *(SCALE_W * (found[slot] @ TRUE[:3, :3] @ state.column()[:3]), *(None,) * 3, 1, state.polarizer_deg),
            )
            for state in made
            for slot in slots
        ]

    taken = [replace(one, analyzer_deg={2: 0.0, 3: 45.0, 4: 90.0, 5: 135.0}[one.slot]) for one in readings(SLOTS)]
    reduced_by = reduction(has_dark=False, calibration=calibration())
    point = reduced_by.point(taken, LampLevel())
    assert_allclose(point.mueller, TRUE[:3, :3], atol=1e-12)
    free = reduction(has_dark=False, calibration=calibration(stderrs=(0.0, 0.0, 0.0))).point(taken, LampLevel())
    added = point.mueller_covariance - free.mueller_covariance
    expected = np.zeros((9, 9))
    for slot, values in SLOTS.items():
        for place, (stderr, step) in enumerate(zip((0.1, 1e-3, 2e-3), (1e-4, 1e-6, 1e-6), strict=True)):
            changed = tuple(value + step * (number == place) for number, value in enumerate(values))
            other = reduction(has_dark=False, calibration=calibration(slots=SLOTS | {slot: changed}))
            slope = (other.point(taken, LampLevel()).mueller - point.mueller).ravel() / step
            expected += np.outer(slope, slope) * stderr**2
    assert_allclose(added, expected, rtol=2e-3, atol=1e-3 * np.abs(expected).max())


def test_a_direction_that_lacks_a_pair_of_settings_is_refused_or_left_out():
    whole = readings_of(TRUE, PLATES[:4], PLATES[:4])
    cut = [replace(one, point=1) for one in whole if one.kind == "dark" or one.time_s < 14.5]
    with pytest.raises(ReductionError, match=r"Point 1 .*15 pairs .* do not tell the 16 elements"):
        reduction().point(cut, LampLevel())
    assert [point.point for point in reduction().scan([*whole, *cut])] == [0]
    assert "cut off before point 1 was finished" in " ".join(reduction().doubts([*whole, *cut], ()))


def noisy_points(true, stderr, count=40, seed=5):
    random = np.random.default_rng(seed)
    point = reduction().point(readings_of(true, PLATES, PLATES), LampLevel())
    root = np.linalg.cholesky(point.mueller_covariance)
    root *= stderr / math.sqrt(np.trace(root @ root.T) / 16)
    return [
        replace(
            point,
            point=number,
            mueller=true + (root @ random.normal(size=16)).reshape(4, 4),
            mueller_covariance=root @ root.T,
        )
        for number in range(count)
    ]


def test_noise_about_a_mirror_is_not_called_unphysical():
    """A mirror depolarizes nothing: three eigenvalues are 0, and noise pushes one of them below in every direction."""
    mirror = Surface([Specular(0.7, 0.1764, 2.950 + 2.932j)]).mueller(math.radians(60), math.radians(EXIT_DEG), math.pi)
    points = noisy_points(mirror, 0.003)
    assert sum(lowest_eigenvalue(point)[0] < 0.0 for point in points) > 30
    assert unphysical(points) == ""


def test_an_analyzer_whose_retardance_is_wrong_by_its_sign_is_found_out():
    flipped = np.diag([1.0, 1.0, 1.0, -1.0]) @ IRON.mueller(math.radians(60), math.radians(EXIT_DEG), math.pi)
    said = unphysical(noisy_points(flipped, 0.001, count=3))
    assert said.startswith("The Mueller matrix is not physical in 3 of 3 directions: at point ")
    assert "retardances in the rig file" in said


def test_the_error_of_the_lowest_eigenvalue_is_its_scatter_where_it_stands_alone():
    apart = IRON.mueller(math.radians(60), math.radians(EXIT_DEG), math.pi) + np.diag([0.3, -0.05, 0.1, 0.0])
    points = noisy_points(apart, 1e-4, count=400)
    found = np.array([lowest_eigenvalue(point) for point in points])
    assert abs(found[:, 0].std() / found[:, 1].mean() - 1.0) < 0.15
