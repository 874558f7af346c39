"""Stokes parameters of every pixel against plain linear algebra, and what is not to be believed marked as such."""

import doctest
import tracemalloc
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.analyzer_matrix import AnalyzerState, analyzer_matrix
from acquisition.imaging.stokes.pixel_formula import PixelFormula, SensorNoise
from acquisition.imaging.stokes.stokes_image import StokesImages
from goniometer.errors import ReductionError

ROOT = Path(__file__).resolve().parents[4]
POLARIZERS = [AnalyzerState(angle_deg) for angle_deg in (3.0, 47.0, 88.0, 136.0)]
RETARDERS = [AnalyzerState(1.5, angle_deg, 88.0) for angle_deg in (-51.7, -15.1, 15.1, 51.7, 80.0)]
NOISE = SensorNoise(read_counts=2.5, electrons_per_count=3.1)
STOKES = ("S0", "S1", "S2")
EVERYTHING = (
    *STOKES,
    *(f"{name}_variance" for name in STOKES),
    "DoLP",
    "DoLP_variance",
    "AoLP_rad",
    "AoLP_rad_variance",
    *(f"{one}_{other}_covariance" for one, other in combinations(STOKES, 2)),
)


def inverse(states):
    return np.linalg.pinv(analyzer_matrix(states))


def frames(states, shape=(37, 53), seed=1):
    """Counts of random light behind states, rounded as a camera does."""
    random = np.random.default_rng(seed)
    s0 = random.uniform(4_000, 40_000, shape)
    degree, azimuth, ellipse = random.uniform(0.05, 0.9, shape), random.uniform(0, 2 * np.pi, shape), 0.3
    s1, s2, s3 = (
        s0 * degree * part
        for part in (np.cos(azimuth) * np.cos(ellipse), np.sin(azimuth) * np.cos(ellipse), np.sin(ellipse))
    )
    stokes = np.array([s0, s1, s2, s3])[: analyzer_matrix(states).shape[1]]
    return stokes, np.rint(np.einsum("js,shw->jhw", analyzer_matrix(states), stokes)).astype(np.uint16)


@pytest.mark.parametrize("states", [POLARIZERS, POLARIZERS[:3], RETARDERS], ids=["four", "three", "retarder"])
def test_the_light_that_made_the_frames_comes_back(states):
    true, stack = frames(states)
    names = tuple(f"S{place}" for place in range(len(true)))
    found = StokesImages(PixelFormula(inverse(states), names)).maps(stack)
    enlarged = np.abs(inverse(states)).sum(axis=1).max() / 2  # by which half a count of rounding is enlarged at most
    for name, expected in zip(names, true, strict=True):
        assert found[name].dtype == np.float32
        assert_allclose(found[name], expected, rtol=3e-7, atol=enlarged)


def test_variances_are_those_of_a_linear_inversion_and_of_the_ratios_made_of_it():
    _, stack = frames(POLARIZERS)
    solve = inverse(POLARIZERS)
    found = StokesImages(PixelFormula(solve, EVERYTHING, noise=NOISE)).maps(stack)
    stokes = np.einsum("sj,jhw->shw", solve, stack.astype(float))
    variance = stack / NOISE.electrons_per_count + NOISE.read_counts**2
    covariance = np.einsum("aj,jhw,bj->abhw", solve, variance, solve)
    for place, name in enumerate(STOKES):
        assert_allclose(found[f"{name}_variance"], covariance[place, place], rtol=1e-5)
    for (at, one), (beside, other) in combinations(enumerate(STOKES), 2):
        size = np.sqrt(covariance[at, at] * covariance[beside, beside])
        assert_allclose(found[f"{one}_{other}_covariance"] / size, covariance[at, beside] / size, atol=2e-6)
    linear = np.hypot(stokes[1], stokes[2])
    by_stokes = {
        "DoLP": np.array([-linear / stokes[0], stokes[1] / linear, stokes[2] / linear]) / stokes[0],
        "AoLP_rad": 0.5 * np.array([0 * linear, -stokes[2], stokes[1]]) / linear**2,
    }
    assert_allclose(found["DoLP"], linear / stokes[0], rtol=1e-5)
    assert_allclose(found["AoLP_rad"], 0.5 * np.arctan2(stokes[2], stokes[1]), atol=1e-6)
    for name, slopes in by_stokes.items():
        expected = np.einsum("ahw,abhw,bhw->hw", slopes, covariance, slopes)
        assert_allclose(found[f"{name}_variance"], expected, rtol=1e-4)


def test_covariances_with_s3_are_those_of_a_linear_inversion():
    _, stack = frames(RETARDERS)
    solve = inverse(RETARDERS)
    names = [f"S{place}" for place in range(4)]
    outputs = tuple(f"{one}_{other}_covariance" for one, other in combinations(names, 2))
    found = StokesImages(PixelFormula(solve, outputs, noise=NOISE)).maps(stack)
    covariance = np.einsum("aj,jhw,bj->abhw", solve, stack / NOISE.electrons_per_count + NOISE.read_counts**2, solve)
    for at, beside in combinations(range(4), 2):
        size = np.sqrt(covariance[at, at] * covariance[beside, beside])
        assert_allclose(found[f"S{at}_S{beside}_covariance"] / size, covariance[at, beside] / size, atol=2e-6)


def test_the_angle_of_polarization_is_right_in_every_direction():
    """Behind 0, 45, 90 and 135 degrees all of this is exact in single precision but for the angle itself."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 20_001)[1:]
    s1, s2 = np.rint(20_000 * np.cos(2 * angle)), np.rint(20_000 * np.sin(2 * angle))
    stack = np.array([30_000 + s1, 30_000 + s2, 30_000 - s1, 30_000 - s2]).astype(np.uint16)[:, None]
    matrix = np.array([[1, 1, 0], [1, 0, 1], [1, -1, 0], [1, 0, -1]])
    found = StokesImages(PixelFormula(np.linalg.pinv(matrix), ("AoLP_rad",))).maps(stack)["AoLP_rad"][0]
    assert_allclose(found, 0.5 * np.arctan2(s2, s1), atol=3e-7)
    assert found[-1] == pytest.approx(np.pi / 2, abs=3e-7)  # S2 is 0 and S1 below it


def test_stated_variances_are_those_of_many_noisy_frames():
    """Poisson electrons and read noise, 4000 times: the scatter of every value is what the reduction states."""
    random, times = np.random.default_rng(7), 4000
    rows = analyzer_matrix(POLARIZERS)
    light = rows @ np.array([20_000.0, 6_000.0, -3_000.0])
    electrons = random.poisson(light[:, None, None] * NOISE.electrons_per_count, (4, 1, times))
    counts = electrons / NOISE.electrons_per_count + random.normal(0, NOISE.read_counts, electrons.shape)
    found = StokesImages(PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE)).maps(
        np.rint(counts).astype(np.uint16)
    )
    for one, other in combinations(STOKES, 2):
        sizes = np.sqrt(found[f"{one}_variance"].mean() * found[f"{other}_variance"].mean())
        correlation = np.mean(
            (found[one] - found[one].mean(dtype=float)) * (found[other] - found[other].mean(dtype=float))
        )
        assert abs(correlation - found[f"{one}_{other}_covariance"].mean()) < 5 * sizes / np.sqrt(times)
    for name in (*STOKES, "DoLP", "AoLP_rad"):
        stated = found[f"{name}_variance"].mean()
        assert abs(found[name].var() / stated - 1) < 5 * np.sqrt(2 / times), name


def test_dark_and_flat_are_taken_out_and_a_bad_pixel_is_not_a_number():
    true, stack = frames(POLARIZERS)
    random = np.random.default_rng(3)
    dark = random.uniform(40, 60, stack.shape[1:]).astype(np.float32)
    flat = random.uniform(0.8, 1.2, stack.shape[1:]).astype(np.float32)
    raw = np.rint(stack * flat + dark).astype(np.uint16)
    flat[5, 6] = np.nan
    formula = PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE, has_dark=True, has_flat=True)
    found = StokesImages(formula, dark=dark, flat=flat).maps(raw)
    is_good = np.isfinite(flat)
    assert all(np.isnan(image[5, 6]) for image in found.values())
    for name, expected in zip(STOKES, true, strict=True):
        assert_allclose(found[name][is_good], expected[is_good], atol=3)
    expected = (raw - dark) / NOISE.electrons_per_count / flat**2 + NOISE.read_counts**2 / flat**2
    variance = np.einsum("j,jhw->hw", inverse(POLARIZERS)[1] ** 2, expected)
    assert_allclose(found["S1_variance"][is_good], variance[is_good], rtol=1e-5)


def test_counts_below_the_dark_have_its_variance_and_no_less():
    stack = np.full((4, 6, 7), 90, np.uint16)
    dark = np.full((6, 7), 100, np.float32)
    formula = PixelFormula(inverse(POLARIZERS), ("S0", "S0_variance"), noise=NOISE, has_dark=True)
    found = StokesImages(formula, dark=dark).maps(stack)
    assert (found["S0"] < 0).all()
    assert_allclose(found["S0_variance"], (inverse(POLARIZERS)[0] ** 2).sum() * NOISE.read_counts**2, rtol=1e-6)


def test_a_pixel_that_any_frame_shows_saturated_says_nothing_and_its_neighbours_all():
    _, stack = frames(POLARIZERS)
    open_ended = StokesImages(PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE)).maps(stack)
    stack[2, 10, 20] = 65_000
    stack[0, 11, 20] = 64_999
    found = StokesImages(PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE, saturation_counts=65_000)).maps(
        stack
    )
    for name, image in found.items():
        assert_array_equal(np.argwhere(np.isnan(image)), [[10, 20]], name)
        others = np.ones(image.shape, bool)
        others[10:12, 20] = False
        assert_array_equal(image[others], open_ended[name][others])


@pytest.mark.parametrize("count", [1, 3, 17, 131_073])
def test_a_pixel_is_the_same_in_any_company(count):
    _, stack = frames(POLARIZERS, shape=(1, count))
    reduction = StokesImages(PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE))
    found = reduction.maps(stack)
    alone = reduction.maps(np.ascontiguousarray(stack[:, :, -1:]))
    assert_array_equal([image[0, -1] for image in found.values()], [image[0, 0] for image in alone.values()])
    tall = reduction.maps(np.ascontiguousarray(stack.swapaxes(1, 2)))
    for name, image in found.items():
        assert_array_equal(tall[name][:, 0], image[0])


def test_bands_are_the_whole_piece_by_piece():
    _, stack = frames(POLARIZERS, shape=(401, 701))
    reduction = StokesImages(PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE))
    whole = np.array(list(reduction.maps(stack).values()))
    end = 0
    for rows, band in reduction.bands(stack):
        assert rows.start == end
        assert_array_equal(band, whole[:, rows])
        end = rows.stop
    assert end == 401
    assert rows.start > 0  # there was more than one


@pytest.mark.parametrize("offset", [0, 1, 7])
@pytest.mark.parametrize("shape", [(40, 60), (37, 53), (1, 5)])
def test_maps_go_into_memory_that_is_given_and_nowhere_else(shape, offset):
    _, stack = frames(POLARIZERS, shape)
    reduction = StokesImages(PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE))
    new = reduction.maps(stack)
    memory = np.full(offset + len(EVERYTHING) * stack[0].size + 30, -7, np.float32)
    out = memory[offset:-30].reshape(len(EVERYTHING), *shape)
    reduction.maps(stack[:, ::-1, ::-1], out)
    given = reduction.maps(stack, out)
    for place, name in enumerate(EVERYTHING):
        assert np.shares_memory(given[name], out[place])
        assert_array_equal(given[name], new[name])
    assert_array_equal(memory[:offset], -7)
    assert_array_equal(memory[-30:], -7)


@pytest.mark.parametrize(
    "out",
    [
        np.empty((3, 8, 10), np.float32),
        np.empty((2, 8, 9), np.float32),
        np.empty((3, 8, 9)),
        np.empty((3, 8, 18), np.float32)[:, :, ::2],
        np.empty((3, 8, 9), ">f4"),
        np.broadcast_to(np.float32(0), (3, 8, 9)),
    ],
    ids=["size", "number", "type", "pieces", "bytes", "constant"],
)
def test_memory_that_does_not_fit_is_refused(out):
    reduction = StokesImages(PixelFormula(inverse(POLARIZERS), STOKES))
    with pytest.raises(ReductionError, match=r"needed is one \(3, 8, 9\) of float32.* Nothing was written"):
        reduction.maps(np.zeros((4, 8, 9), np.uint16), out)


def test_a_part_of_larger_frames_is_reduced_as_its_copy():
    _, stack = frames(POLARIZERS, (90, 80))
    reduction = StokesImages(PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE))
    for part in (stack[:, 3:50, 7:60], stack[:, ::2, ::-3], stack.swapaxes(1, 2)):
        copied = reduction.maps(np.ascontiguousarray(part))
        for name, image in reduction.maps(part).items():
            assert_array_equal(image, copied[name])


def test_memory_stays_below_three_times_that_of_the_frames():
    stack = np.full((4, 2048, 2448), 900, np.uint16)
    stokes = StokesImages(PixelFormula(inverse(POLARIZERS), STOKES))
    everything = StokesImages(PixelFormula(inverse(POLARIZERS), EVERYTHING, noise=NOISE))
    mirrored = stack[:, ::-1, ::-1]  # whose frames are copied to be read, some rows at a time
    peaks = []
    for reduce in (
        lambda: stokes.maps(stack),
        lambda: stokes.maps(mirrored),
        lambda: [len(band) for _, band in everything.bands(stack)],
    ):
        tracemalloc.start()
        reduce()
        peaks.append(stack.nbytes + tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert max(peaks) < 2.7 * stack.nbytes


@pytest.mark.parametrize(
    ("outputs", "noise", "what"),
    [
        (("S0", "S3"), None, r"S3 cannot be computed of a pixel with 3 Stokes parameters. There are S0, S1, S2, DoLP"),
        (("DolP", "S1_S0_covariance"), NOISE, "DolP, S1_S0_covariance cannot be computed"),
        (("S0", "S0_S1_covariance"), None, "need the sensor's noise"),
    ],
)
def test_what_cannot_be_known_is_refused(outputs, noise, what):
    with pytest.raises(ReductionError, match=what):
        PixelFormula(inverse(POLARIZERS), outputs, noise=noise)


@pytest.mark.parametrize(
    ("stack", "what"),
    [
        (np.zeros((3, 8, 9), np.uint16), r"\(3, 8, 9\) of uint16; needed are 4 frames of 8x9"),
        (np.zeros((4, 9, 8), np.uint16), r"\(4, 9, 8\) of uint16; needed are 4 frames of 8x9"),
        (np.zeros((4, 8, 9), np.uint8), "of uint8"),
        (np.zeros((4, 8, 9), np.dtype(np.uint16).newbyteorder()), "of [<>]u2; .* of this machine's byte order"),
        (np.zeros((4, 0, 9), np.uint16), r"\(4, 0, 9\) of uint16"),
    ],
)
def test_frames_of_another_number_size_or_depth_are_refused(stack, what):
    formula = PixelFormula(inverse(POLARIZERS), STOKES, has_dark=True)
    with pytest.raises(ReductionError, match=what):
        StokesImages(formula, dark=np.zeros((8, 9), np.float32)).maps(stack)


def test_the_example_of_the_documentation_is_true():
    told = doctest.testfile(str(ROOT / "docs" / "imaging.md"), module_relative=False, encoding="utf-8")
    assert (told.failed, told.attempted > 10) == (0, True)
