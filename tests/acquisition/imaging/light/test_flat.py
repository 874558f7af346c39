"""Sensitivity from even light, and its file."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.imaging.light.flat import Flat
from acquisition.imaging.light.signal_image import SignalImage
from drivers.camera.region import Region
from goniometer.errors import ReductionError

cv2 = pytest.importorskip("cv2")


def even(seed=5):
    random = np.random.default_rng(seed)
    signal = random.uniform(700, 1_300, (20, 30)).astype(np.float32)
    return SignalImage(signal, signal / 50)


def test_the_mean_is_one_over_good_pixels_and_others_are_bad():
    image = even()
    image.signal[1, 2] = 3.0
    image.signal[3, 4] = 50_000.0
    image.signal[5, 6] = np.nan
    flat = Flat.of(image)
    assert_array_equal(np.argwhere(flat.is_bad), [[1, 2], [3, 4], [5, 6]])
    assert_array_equal(flat.is_bad, np.isnan(flat.relative_variance))
    is_good = ~flat.is_bad
    assert flat.sensitivity[is_good].mean(dtype=float) == pytest.approx(1, abs=1e-6)
    assert_allclose(flat.sensitivity[is_good], (image.signal / image.signal[is_good].mean())[is_good], rtol=1e-5)
    assert_allclose(flat.relative_variance[is_good], 1 / 50 / image.signal[is_good], rtol=1e-5)
    assert flat.sensitivity.dtype == flat.relative_variance.dtype == np.float32


def test_the_light_of_a_region_is_what_it_was_without_a_flat():
    """For it was with that region's counts that power was calibrated."""
    image, region = even(), Region(4, 2, 7, 9)
    image.signal[3, 5] = np.nan
    flat = Flat.of(image)
    beside, within = flat.beside(region), (slice(2, 11), slice(4, 11))
    assert abs(np.nanmean(flat.sensitivity[within]) - 1) > 0.01
    assert np.nanmean(beside.sensitivity[within]) == pytest.approx(1, abs=1e-6)
    assert_allclose(beside.sensitivity / beside.sensitivity[0, 0], flat.sensitivity / flat.sensitivity[0, 0], rtol=1e-6)
    assert_array_equal(beside.relative_variance, flat.relative_variance)


def test_a_region_of_bad_pixels_alone_is_refused():
    image = even()
    image.signal[2:5, 3:6] = np.nan
    with pytest.raises(ReductionError, match=r"nothing of the region .* It was not used\. Choose another"):
        Flat.of(image).beside(Region(3, 2, 3, 3))


def test_limits_are_relative_to_the_median():
    image = even()
    flat = Flat.of(image, dimmest=0.9, brightest=1.1)
    relative = image.signal / np.median(image.signal)
    assert_array_equal(flat.is_bad, (relative < 0.9) | (relative > 1.1))


@pytest.mark.parametrize("signal", [np.zeros((3, 4)), np.full((3, 4), np.nan), -np.ones((3, 4))])
def test_flat_frames_without_light_make_none(signal):
    with pytest.raises(ReductionError, match="no light in them"):
        Flat.of(SignalImage(signal.astype(np.float32), signal.astype(np.float32)))


def test_a_flat_comes_back_from_its_file_as_it_was(tmp_path):
    image = even()
    image.signal[1, 2] = 0.0
    flat = Flat.of(image)
    flat.save(tmp_path / "flat.tiff")
    found = Flat.load(tmp_path / "flat.tiff")
    assert_array_equal(found.sensitivity, flat.sensitivity)
    assert_array_equal(found.relative_variance, flat.relative_variance)


def test_other_files_are_no_flats(tmp_path):
    flat = Flat.of(even())
    flat.save(tmp_path / "flat.tiff")
    content = (tmp_path / "flat.tiff").read_bytes()
    good = flat.sensitivity
    Flat(good * 1_000, good).save(tmp_path / "scaled.tiff")
    Flat(np.where(good < good.mean(), -good, good * 3), good).save(tmp_path / "negative.tiff")
    holed, wrong = good.copy(), good.copy()
    holed[1, 2], wrong[1, 2] = np.inf, -0.1
    Flat(holed, good).save(tmp_path / "infinite.tiff")
    Flat(good, wrong).save(tmp_path / "variance.tiff")
    wrong[1, 2] = np.nan
    Flat(good, wrong).save(tmp_path / "unknown.tiff")
    Flat(np.full_like(good, np.nan), good).save(tmp_path / "bad.tiff")
    (tmp_path / "text.tiff").write_text("1 1 1")
    (tmp_path / "empty.tiff").write_bytes(b"")
    (tmp_path / "page.tiff").write_bytes(cv2.imencode(".tiff", good)[1].tobytes())
    (tmp_path / "whole.tiff").write_bytes(cv2.imencodemulti(".tiff", [good.astype(np.uint16)] * 2)[1].tobytes())
    (tmp_path / "cut.tiff").write_bytes(content[: len(content) // 2])
    given = "scaled", "negative", "infinite", "variance", "unknown", "bad"
    for name in (*given, "text", "empty", "page", "whole", "cut"):
        with pytest.raises(ReductionError, match=rf"{name}\.tiff is no flat"):
            Flat.load(tmp_path / f"{name}.tiff")
    with pytest.raises(FileNotFoundError, match=r"nowhere\.tiff"):
        Flat.load(tmp_path / "nowhere.tiff")
