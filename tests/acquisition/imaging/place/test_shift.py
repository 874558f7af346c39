"""A picture moved back: whole pixels, parts of them, and what comes from outside."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.imaging.light.signal_image import SignalImage
from acquisition.imaging.place.shift import shifted


def ramp(column_px=0.0, row_px=0.0, shape=(20, 30)):
    """Light that rises evenly, displaced to the right and down."""
    rows, columns = np.indices(shape, dtype=np.float32)
    signal = 3.0 * (columns - column_px) - 2.0 * (rows - row_px) + 100.0
    return SignalImage(signal.astype(np.float32), np.full(shape, 4.0, np.float32))


@pytest.mark.parametrize("shift", [(0.0, 0.0), (2.0, -3.0), (0.25, 0.6), (-1.75, 2.5), (-0.4, -0.01)])
def test_what_is_displaced_comes_back_to_its_place(shift):
    back = shifted(ramp(*shift), *shift)
    is_known = np.isfinite(back.signal)
    lost = [int(np.ceil(abs(part))) for part in shift]
    assert is_known.sum() == (30 - lost[0]) * (20 - lost[1])
    assert_allclose(back.signal[is_known], ramp().signal[is_known], rtol=1e-5)
    assert_array_equal(np.isnan(back.variance), ~is_known)


def test_the_noise_of_an_interpolated_pixel_is_that_of_its_weights():
    random = np.random.default_rng(5)
    noisy = SignalImage(random.normal(0, 2, (400, 500)).astype(np.float32), np.full((400, 500), 4.0, np.float32))
    back = shifted(noisy, 0.3, -0.4)
    stated = np.nanmean(back.variance)
    assert_allclose(stated, 4.0 * (0.7**2 + 0.3**2) * (0.4**2 + 0.6**2), rtol=1e-5)
    assert_allclose(np.nanvar(back.signal), stated, rtol=0.02)


def test_a_pixel_of_which_nothing_is_known_spreads_to_those_made_of_it_alone():
    image = ramp()
    image.signal[7, 9] = np.nan
    unknown = np.argwhere(np.isnan(shifted(image, 0.5, 1.0).signal[:18, :28]))
    assert_array_equal(unknown, [[6, 8], [6, 9]])


def test_a_picture_displaced_beyond_its_width_leaves_nothing():
    assert np.isnan(shifted(ramp(), 40.0, 0.0).signal).all()
