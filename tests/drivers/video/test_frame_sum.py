from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from drivers.camera.frame_sum import FrameSum


@pytest.mark.parametrize("frames", [1, 2, 7, 257, 300])
def test_mean_keeps_the_digits_that_averaging_wins(frames):
    pictures = np.random.default_rng(frames).integers(0, 255, (frames, 5, 7), dtype=np.uint8)
    total = FrameSum()
    for picture in pictures:
        total.add(picture)
    assert total.frames == frames
    assert total.mean_counts().dtype == np.uint16
    assert_allclose(total.mean_counts() / 257, pictures.mean(axis=0), rtol=0, atol=0.5 / 257 + 1e-12)


def test_pixel_saturated_in_one_picture_only_is_saturated():
    total = FrameSum()
    total.add(np.array([[255, 254, 0]], np.uint8))
    total.add(np.array([[3, 254, 0]], np.uint8))
    assert_array_equal(total.mean_counts(), [[65535, 254 * 257, 0]])


def test_a_picture_changed_later_is_not_changed_in_the_sum():
    total, picture = FrameSum(), np.full((2, 2), 10, np.uint8)
    total.add(picture)
    picture[:] = 200
    assert_array_equal(total.mean_counts(), np.full((2, 2), 2570))


def test_no_picture_has_no_mean():
    with pytest.raises(ValueError, match="no mean of no pictures"):
        FrameSum().mean_counts()
