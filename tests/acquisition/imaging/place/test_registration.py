"""Displacements between pictures behind different analyzer positions."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.imaging.place.registration import shifts
from goniometer.errors import ReductionError

TRUE = np.array([(0, 0), (0.37, -0.62), (1.43, 0.81), (-2.25, 0.5)])
# Light of the left and the right material and of white paper behind each position: the brighter one changes.
INVERTING = [(0.5, 0.2, 0.8), (0.3, 0.35, 0.8), (0.15, 0.6, 0.8), (0.35, 0.3, 0.8)]


@pytest.fixture(scope="module")
def pictures(drawing):
    @cache
    def draw(exit_deg, noise, hidden=()):
        return [
            drawing.View(exit_deg, shift_px=tuple(shift)).picture(
                drawing.plate(left, right, white=white, black=0.05 * white, hidden=hidden),
                noise=noise,
                seed=seed,
                fine=4,
            )
            for seed, ((left, right, white), shift) in enumerate(zip(INVERTING, TRUE, strict=True))
        ]

    return draw


@pytest.mark.parametrize("method", ["ecc", "phase"])
@pytest.mark.parametrize(("across", "dots"), [(1.0, 0.0), (1.0, 0.05), (0.3, 0.0)])
def test_a_straight_border_does_not_tell_how_far_it_moved_along_itself(method, across, dots):
    """Whatever little else there is, the picture's margin stands still, and would be followed instead."""
    row, column = np.mgrid[0:200, 0:260].astype(float)
    border = across / (1 + np.exp(np.clip((100.0 - column - 0.2 * row) / 0.8, -50, 50)))
    places = np.random.default_rng(4).uniform((40, 40), (160, 220), (3, 2))

    def picture(shift, low, high, seed):
        spots = sum(np.exp(-((row - y - shift) ** 2 + (column - x - 0.2 * shift) ** 2) / 20) for y, x in places)
        light = (low + (high - low) * border) * (1 - dots * spots)
        return np.random.default_rng(seed).poisson(20_000 * light) / 20_000

    with pytest.raises(ReductionError, match=r"lies along one direction, like a straight border.*Put markers or"):
        shifts([picture(0.0, 1.0, 2.0, 0), picture(1.5, 1.6, 0.8, 1)], method=method)


@pytest.mark.parametrize("exit_deg", [0.0, 60.0])
def test_displacements_are_found_although_the_contrast_inverts(pictures, exit_deg):
    found = shifts(pictures(exit_deg, 0.02))
    assert_allclose(found.shifts_px, TRUE, atol=0.05)
    assert (found.correlations > 0.8).all()


def test_the_border_of_two_materials_is_enough_without_any_marker(pictures):
    found = shifts(pictures(0.0, 0.02, hidden=(0, 1, 2, 3)))
    assert_allclose(found.shifts_px, TRUE, atol=0.05)


def test_phase_correlation_finds_the_same(pictures):
    assert_allclose(shifts(pictures(0.0, 0.02), method="phase").shifts_px, TRUE, atol=0.05)


def test_bad_pixels_and_glare_without_value_leave_displacements_as_they_are(pictures):
    views = [view.copy() for view in pictures(0.0, 0.02)]
    random = np.random.default_rng(5)
    bad = random.random(views[0].shape) < 0.01  # the sensor's own: they do not move with the light
    for view in views:
        view[bad] = np.nan
    views[2][110:140, 150:190] = np.nan
    assert_allclose(shifts(views).shifts_px, TRUE, atol=0.07)


@pytest.mark.parametrize("method", ["ecc", "phase"])
def test_pictures_of_noise_share_nothing(method):
    random = np.random.default_rng(1)
    views = [0.1 + 0.02 * random.standard_normal((120, 160)) for _ in range(2)]
    with pytest.raises(ReductionError, match="Picture 2 of 2 behind the analyzer shares too little structure with"):
        shifts(views, method=method)


@pytest.mark.parametrize("dark", [np.full((120, 160), 0.3), np.full((120, 160), np.nan)], ids=["even", "unknown"])
def test_an_empty_picture_is_refused(pictures, dark):
    view = pictures(0.0, 0.02)[0][:120, :160]
    with pytest.raises(ReductionError, match="too little structure with the first: their edges correlate by 0"):
        shifts([view, dark])


def test_a_large_displacement_is_refused_with_its_value(pictures):
    view = pictures(0.0, 0.02)[0]
    with pytest.raises(
        ReductionError, match=r"Picture 2 of 2 .* displaced by -3\.00, 4\.00 pixels .* more than the 4\.5"
    ):
        shifts([view, np.roll(view, (4, -3), (0, 1))], max_shift_px=4.5)
