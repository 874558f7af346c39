"""Stokes parameters of signals that know their own variances, against plain linear algebra."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.analyzer_matrix import AnalyzerState, analyzer_matrix
from acquisition.imaging.light.signal_image import SignalImage
from acquisition.imaging.stokes.pixel_formula import PixelFormula, SensorNoise
from acquisition.imaging.stokes.pixel_values import outputs_of
from acquisition.imaging.stokes.signal_stokes import SignalStokes
from acquisition.imaging.stokes.stokes_image import StokesImages
from acquisition.imaging.stokes.stokes_inverse import inverse_of
from goniometer.errors import ReductionError

POLARIZERS = [AnalyzerState(angle_deg) for angle_deg in (3.0, 47.0, 88.0, 136.0, 170.0)]
RETARDERS = [AnalyzerState(1.5, angle_deg, 88.0) for angle_deg in (-51.7, -15.1, 15.1, 51.7)]


def signals(states, shape=(41, 30), seed=2, scale=1.0):
    """Random light behind states, each pixel with a noise of its own; and the light, (3 or 4, height, width)."""
    random = np.random.default_rng(seed)
    matrix = analyzer_matrix(states)
    stokes = random.uniform(-0.4, 0.4, (matrix.shape[1], *shape))
    stokes[0] = random.uniform(0.8, 3.0, shape)
    light = scale * np.einsum("js,shw->jhw", matrix, stokes)
    variance = (scale * random.uniform(1e-4, 1e-1, light.shape)) ** 2
    images = [SignalImage(*(part.astype(np.float32) for part in pair)) for pair in zip(light, variance, strict=True)]
    return images, scale * stokes


def linear_algebra(inverse, images):
    """Everything in double precision: values, covariances by central differences of the formulas themselves."""
    light = np.array([image.signal for image in images], float)
    variance = np.array([image.variance for image in images], float)

    def values(light):
        stokes = np.einsum("sj,jhw->shw", inverse, light)
        found = {f"S{place}": one for place, one in enumerate(stokes)}
        found["DoLP"] = np.hypot(stokes[1], stokes[2]) / stokes[0]
        found["AoLP_rad"] = 0.5 * np.arctan2(stokes[2], stokes[1])
        return found

    expected = values(light)
    slopes = {name: np.zeros_like(light) for name in expected}
    for state in range(len(light)):
        step = np.zeros_like(light)
        step[state] = 1e-5 * np.abs(light).max()
        above, below = values(light + step), values(light - step)
        for name, slope in slopes.items():
            change = above[name] - below[name]
            if name == "AoLP_rad":
                change = (change + np.pi / 2) % np.pi - np.pi / 2
            slope[state] = change / (2 * step[state])
    for name, slope in slopes.items():
        expected[f"{name}_variance"] = (slope**2 * variance).sum(axis=0)
    for one, other in combinations([name for name in slopes if name.startswith("S")], 2):
        expected[f"{one}_{other}_covariance"] = (slopes[one] * slopes[other] * variance).sum(axis=0)
    return expected


@pytest.mark.parametrize("scale", [1e-9, 1.0, 3e7], ids=["faint", "one", "bright"])
@pytest.mark.parametrize("states", [POLARIZERS, RETARDERS], ids=["polarizers", "retarder"])
def test_values_and_covariances_are_those_of_linear_algebra(states, scale):
    images, true = signals(states, scale=scale)
    inverse = inverse_of(states)
    outputs = outputs_of(len(true))
    found = SignalStokes(inverse, outputs).maps(images)
    expected = linear_algebra(inverse, images)
    assert set(found) == set(expected) == set(outputs)
    for place, light in enumerate(true):
        assert_allclose(found[f"S{place}"], light, atol=2e-6 * scale)
        assert_allclose(found[f"S{place}_variance"], expected[f"S{place}_variance"], rtol=3e-6)
    assert_allclose(found["DoLP"], expected["DoLP"], atol=1e-6)
    polarized = expected["DoLP"] > 0.05
    around = (found["AoLP_rad"] - expected["AoLP_rad"] + np.pi / 2) % np.pi - np.pi / 2
    assert np.abs(around[polarized]).max() < 5e-6
    for name in ("DoLP_variance", "AoLP_rad_variance"):
        assert_allclose(found[name][polarized], expected[name][polarized], rtol=1e-4)
    for one, other in combinations([f"S{place}" for place in range(len(true))], 2):
        sizes = np.sqrt(expected[f"{one}_variance"] * expected[f"{other}_variance"])
        name = f"{one}_{other}_covariance"
        assert_allclose(found[name] / sizes, expected[name] / sizes, atol=2e-6)


def test_counts_and_the_signals_made_of_them_give_the_same():
    counts = np.random.default_rng(4).integers(500, 60_000, (5, 20, 31), dtype=np.uint16)
    noise = SensorNoise(read_counts=2.5, electrons_per_count=3.1)
    inverse, outputs = inverse_of(POLARIZERS), outputs_of(3)
    variance = (counts / noise.electrons_per_count + noise.read_counts**2).astype(np.float32)
    images = [SignalImage(*pair) for pair in zip(counts.astype(np.float32), variance, strict=True)]
    of_counts = StokesImages(PixelFormula(inverse, outputs, noise)).maps(counts)
    for name, image in SignalStokes(inverse, outputs).maps(images).items():
        tolerance = 1e-6 * np.abs(image).max() if "covariance" in name else 0.0
        assert_allclose(image, of_counts[name], rtol=2e-6, atol=tolerance, err_msg=name)


@pytest.mark.parametrize("outputs", [outputs_of(3), ("S2",), ("DoLP",), ("AoLP_rad",), ("S0", "S1_S2_covariance")])
def test_where_any_signal_is_unknown_everything_is(outputs):
    """Also behind a state that a Stokes parameter does not need."""
    states = [AnalyzerState(angle_deg) for angle_deg in (0.0, 45.0, 90.0, 135.0)]
    images, _ = signals(states)
    reduction = SignalStokes(inverse_of(states), outputs)
    before = reduction.maps(images)
    for state, image in enumerate(images):
        for part in (image.signal, image.variance):
            part[7, 3 + state] = np.nan
    found = reduction.maps(images)
    for name, image in found.items():
        assert_array_equal(np.argwhere(np.isnan(image)), [[7, 3 + state] for state in range(4)], name)
        assert_array_equal(image[~np.isnan(image)], before[name][~np.isnan(image)])


def test_darkness_has_stokes_parameters_and_no_polarization():
    images = [SignalImage(np.zeros((2, 3), np.float32), np.full((2, 3), 4.0, np.float32)) for _ in POLARIZERS]
    found = SignalStokes(inverse_of(POLARIZERS), outputs_of(3)).maps(images)
    for name, image in found.items():
        assert np.isnan(image).all() == ("LP" in name), name
    assert_array_equal(found["S1"], 0.0)


def test_bands_given_memory_and_pieces_of_pictures_give_the_same():
    images, _ = signals(POLARIZERS, shape=(411, 701))
    reduction = SignalStokes(inverse_of(POLARIZERS), outputs_of(3))
    whole = np.array(list(reduction.maps(images).values()))
    out = np.full_like(whole, -1.0)
    reduction.maps(images, out)
    assert_array_equal(out, whole)
    pieces = [SignalImage(np.asfortranarray(image.signal), np.asfortranarray(image.variance)) for image in images]
    assert_array_equal(list(reduction.maps(pieces).values()), whole)
    by_bands = np.full_like(whole, -1.0)
    for rows, band in reduction.bands(images):
        by_bands[:, rows] = band
    assert_array_equal(by_bands, whole)


def test_pictures_of_another_number_size_or_type_are_refused():
    images, _ = signals(POLARIZERS, shape=(8, 9))
    reduction = SignalStokes(inverse_of(POLARIZERS), ("S0", "S0_variance"))
    smaller = SignalImage(images[0].signal[1:], images[0].variance[1:])
    double = replace(images[0], variance=images[0].variance.astype(float))
    for wrong, what in (
        (images[1:], r"are 4 pictures with arrays \(8, 9\) of float32; needed are 5 of one size"),
        ([smaller, *images[1:]], r"\(7, 9\) of float32 and \(8, 9\) of float32"),
        ([double, *images[1:]], r"\(8, 9\) of float32 and \(8, 9\) of float64"),
        ([], "are 0 pictures with arrays nothing"),
    ):
        with pytest.raises(ReductionError, match=what):
            reduction.maps(wrong)
        with pytest.raises(ReductionError, match=what):
            reduction.bands(wrong)


def test_what_cannot_be_known_is_refused():
    with pytest.raises(ReductionError, match="S3_variance cannot be computed of a pixel with 3 Stokes parameters"):
        SignalStokes(inverse_of(POLARIZERS), ("S0", "S3_variance"))
