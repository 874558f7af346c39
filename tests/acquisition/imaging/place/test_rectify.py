"""Pictures in the sample's own coordinates, from any direction."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.imaging.light.signal_image import SignalImage
from acquisition.imaging.place.arms import Arms
from acquisition.imaging.place.map_grid import MapGrid
from acquisition.imaging.place.markers import seen
from acquisition.imaging.place.optics import Optics
from acquisition.imaging.place.pose import Pose, pose
from acquisition.imaging.place.rectify import rectified, samples_a_pixel

STEEP = Pose(Arms(60.0, 35.0, 20.0).rotation(), np.array([0.5, -0.3, 300.0]))
OPTICS = Optics(950.0, (79.0, 61.0), (-0.2, 0.05, 1e-3, -5e-4, 0.0))
SIZE = (120, 160)


def image(signal, variance=0.04):
    return SignalImage(np.asarray(signal, np.float32), np.full(np.shape(signal), variance, np.float32))


def spots(mapped, grid, at_mm):
    """Centres of dark spots in a map, in mm: of what is missing to their surroundings."""
    for x_mm, y_mm in at_mm:
        columns, rows = abs(grid.x_mm() - x_mm) < 2.5, abs(grid.y_mm() - y_mm) < 2.5
        part = mapped[np.ix_(rows, columns)].astype(float)
        missing = np.clip(np.median(part[[0, -1]]) - part - 0.04, 0.0, None)
        x, y = np.meshgrid(grid.x_mm()[columns], grid.y_mm()[rows])
        yield (x * missing).sum() / missing.sum(), (y * missing).sum() / missing.sum()


@pytest.mark.parametrize("spread_px", [(0.0, 0.0), (2.37, -1.62)], ids=["still", "behind a wedge"])
def test_features_of_the_plate_lie_at_the_same_place_from_all_directions(drawing, spread_px):
    """Within 0.3 pixel across exit angles 0 to 60°, the issue of the whole exercise; and where they truly are."""
    optics = Optics(1900.0, (160.3, 118.6), (-0.3, 0.1, 1e-3, -5e-4, 0.0))
    drawn = drawing.plate()
    grid = MapGrid(-11.0, 13.0, 300.0 / 1900.0, 139, 165)  # as large as the camera's own pixels
    at_mm = [(x, y) for x in (-8.0, 8.0) for y in (-9.0, 0.0, 9.0)]
    centres, borders = [], []
    for number, exit_deg in enumerate((0.0, 15.0, 30.0, 45.0, 60.0)):
        still, wedge = (
            drawing.View(exit_deg, optics=optics, shift_px=shift).picture(drawn, fine=5, seed=number)
            for shift in ((0.0, 0.0), spread_px)
        )
        found = pose(seen(still, drawing.HOLDER, exit_deg), optics, Arms(60.0, exit_deg))
        mapped = rectified(image(wedge), found, optics, grid, spread_px).signal
        centres.append(list(spots(mapped, grid, at_mm)))
        upper, lower = mapped[np.ix_(abs(grid.y_mm() - 4.5) < 2, abs(grid.x_mm()) < 5)].mean(axis=0), (0.5 + 0.35) / 2
        falls = np.flatnonzero((upper[:-1] >= lower) & (upper[1:] < lower))[0]
        x = grid.x_mm()[abs(grid.x_mm()) < 5]
        borders.append(x[falls] + (upper[falls] - lower) / (upper[falls] - upper[falls + 1]) * grid.pixel_mm)
    centres_px, borders_px = np.array(centres) / grid.pixel_mm, np.array(borders) / grid.pixel_mm
    assert np.ptp(centres_px, axis=0).max() < 0.15
    assert np.ptp(borders_px) < 0.15
    assert_allclose(centres_px, np.broadcast_to(np.array(at_mm) / grid.pixel_mm, centres_px.shape), atol=0.15)
    assert_allclose(borders_px, 0.0, atol=0.15)


def test_a_picture_that_grows_evenly_is_read_where_the_pose_says():
    rows, columns = np.indices(SIZE)
    grid = MapGrid(-12.0, 9.0, 0.4, 50, 40)
    shift = (1.5, -2.25)
    mapped = rectified(image(3.0 * columns + 100.0 * rows), STEEP, OPTICS, grid, shift).signal
    x, y = np.meshgrid(grid.x_mm(), grid.y_mm())
    where = STEEP.pixels(x, y, OPTICS) + shift
    assert_allclose(mapped, 3.0 * where[..., 0] + 100.0 * where[..., 1], rtol=1e-5)


@pytest.mark.parametrize("pixel_mm", [0.15, 0.4, 2.0], ids=["finer", "alike", "coarser"])
def test_variances_are_those_of_the_same_sums_of_noise(pixel_mm):
    random = np.random.default_rng(3)
    grid = MapGrid(-6.0, 5.0, pixel_mm, 5, 4)
    of_pixel = random.uniform(0.5, 2.0, SIZE).astype(np.float32)
    found = [
        rectified(
            SignalImage((np.sqrt(of_pixel) * random.standard_normal(SIZE)).astype(np.float32), of_pixel),
            STEEP,
            OPTICS,
            grid,
        )
        for _ in range(800)
    ]
    scatter = np.var([one.signal for one in found], axis=0)
    assert_allclose(found[0].variance, scatter, rtol=0.25)
    assert_allclose(found[0].variance.mean(), scatter.mean(), rtol=0.06)


def test_a_coarse_pixel_is_the_mean_of_all_that_lies_within_it():
    grid = MapGrid(-4.0, 4.0, 4.0, 2, 2)
    assert min(samples_a_pixel(STEEP, OPTICS, grid)) >= 9
    random = np.random.default_rng(4)
    signal = random.uniform(0.0, 1.0, SIZE)
    fine = MapGrid(-4.0, 4.0, 0.04, 200, 200)
    expected = rectified(image(signal), STEEP, OPTICS, fine).signal.reshape(2, 100, 2, 100).mean(axis=(1, 3))
    assert_allclose(rectified(image(signal), STEEP, OPTICS, grid).signal, expected, atol=0.01)


@pytest.mark.parametrize("pixel_mm", [0.4, 1.3])
def test_what_an_unknown_pixel_would_touch_is_unknown_and_nothing_else(pixel_mm):
    grid = MapGrid(-8.0, 8.0, pixel_mm, int(16 / pixel_mm), int(16 / pixel_mm))
    signal = np.ones(SIZE)
    signal[60, 81] = np.nan
    found = rectified(image(signal), STEEP, OPTICS, grid)
    signal[60, 81] = 1e6
    reached = rectified(image(signal), STEEP, OPTICS, grid).signal > 1.5
    assert 0 < reached.sum() < 20
    assert_array_equal(np.isnan(found.signal), reached)
    assert_array_equal(np.isnan(found.variance), reached)


def test_beyond_the_picture_nothing_is_known():
    grid = MapGrid(-60.0, 40.0, 1.0, 120, 80)
    found = rectified(image(np.ones(SIZE)), STEEP, OPTICS, grid)
    x, y = np.meshgrid(grid.x_mm(), grid.y_mm())
    outside = (np.abs(STEEP.pixels(x, y, OPTICS) - (79.5, 59.5)) > (83.0, 63.0)).any(axis=-1)
    assert np.isnan(found.signal[outside]).all()
    assert_allclose(found.signal[~np.isnan(found.signal)], 1.0, rtol=1e-6)
    assert np.isfinite(found.signal).sum() > 500


def test_an_image_drawn_in_many_bands_is_the_same_as_in_one(monkeypatch):
    grid = MapGrid(-8.0, 8.0, 0.4, 40, 40)
    signal = np.random.default_rng(1).uniform(size=SIZE)
    whole = rectified(image(signal), STEEP, OPTICS, grid)
    monkeypatch.setattr("acquisition.imaging.place.rectify._BAND_SAMPLES", 300)
    assert_array_equal(rectified(image(signal), STEEP, OPTICS, grid).signal, whole.signal)
