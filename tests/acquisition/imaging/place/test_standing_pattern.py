"""Displacements although the sensor's own pattern stands still: pixels that are more or less sensitive, or dead."""

from functools import cache

import numpy as np
import pytest

from acquisition.imaging.place.registration import shifts
from goniometer.errors import ReductionError
from sim_devices.camera.sensor import Sensor, SensorParts

MOVED = np.array([(0, 0), (0.37, -0.62), (-2.25, 0.5), (1.9, 2.1)])
RESTING = np.zeros((3, 2))
COUNTS = 30_000.0
PARTS = {"electrons_per_count": 5.0, "read_counts": 4.0}


@pytest.fixture(scope="module")
def pictures(drawing):
    @cache
    def light(shift_px):
        view = drawing.View(30.0, shift_px=shift_px)
        return view.picture(drawing.plate(hidden=(0, 1, 2, 3)), noise=0.0, fine=4)

    def seen(shifts_px, contrast, seed=1, **parts):
        """Light, relative to its mean, by a sensor as simulated cameras have it; contrast 1 is that of the plate."""
        of_scene = [light(tuple(map(float, shift))) for shift in shifts_px]
        sensor = Sensor(SensorParts(**PARTS, **parts), *of_scene[0].shape, joules_per_count=1.0, seed=seed)
        powers = [COUNTS * (1 + contrast * (scene / of_scene[0].mean() - 1)) for scene in of_scene]
        return [sensor.counts(power, 1.0, 0.0, 16, number).astype(float) for number, power in enumerate(powers)]

    return seen


def largest_error(found, true):
    return np.hypot(*(found.shifts_px - true).T).max()


@pytest.mark.parametrize("method", ["ecc", "phase"])
@pytest.mark.parametrize("true", [MOVED, MOVED / 5, RESTING], ids=["moved", "little", "resting"])
@pytest.mark.parametrize(
    ("contrast", "prnu", "within_px"),
    [
        (0.5, None, 0.05),
        (0.5, 0.02, 0.05),
        (0.5, 0.05, 0.07),
        (0.05, None, 0.05),
        (0.05, 0.01, 0.1),
        (0.05, 0.02, 0.12),
    ],
)
def test_displacements_are_those_of_the_scene(pictures, method, true, contrast, prnu, within_px):
    assert largest_error(shifts(pictures(true, contrast, prnu=prnu), method=method), true) < within_px


@pytest.mark.parametrize("method", ["ecc", "phase"])
def test_dead_pixels_are_not_followed(pictures, method):
    found = shifts(pictures(MOVED, 0.05, prnu=0.01, dead_pixels=40), method=method)
    assert largest_error(found, MOVED) < 0.12


def test_errors_are_as_large_as_stated(pictures):
    ratios = []
    for seed in range(12):
        found = shifts(pictures(MOVED, 0.04, seed=seed, prnu=0.02))
        ratios.append(np.square(found.shifts_px - MOVED)[1:].sum() / np.square(found.stderr_px).sum())
    assert 0.4 < np.sqrt(np.mean(ratios)) < 1.6


@pytest.mark.parametrize("method", ["ecc", "phase"])
@pytest.mark.parametrize("seed", range(4))
def test_a_scene_that_the_pattern_hides_is_refused(pictures, method, seed):
    for contrast in (0.0, 0.003):
        with pytest.raises(ReductionError, match="name a flat of the sensor"):
            shifts(pictures(MOVED, contrast, seed=seed, prnu=0.05), method=method)


def test_a_lens_that_vignettes_has_no_edges(pictures):
    """It stands still as well, and is smooth."""
    rows, columns = np.mgrid[-119.5:120, -159.5:160]
    falling = 1 / (1 + (rows**2 + columns**2) / 900**2) ** 2
    found = shifts([falling * picture for picture in pictures(MOVED, 0.05, prnu=0.01)])
    assert largest_error(found, MOVED) < 0.12
    with pytest.raises(ReductionError, match="shares too little structure"):
        shifts([falling * picture for picture in pictures(MOVED, 0.0, prnu=0.01)])
