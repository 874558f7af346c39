"""From counts in a region to power."""

import numpy as np
import pytest

from acquisition.imaging.light.sensor import Sensor
from acquisition.imaging.stokes.pixel_formula import SensorNoise
from drivers.camera.frame import Frame
from drivers.camera.photometer import Photometer
from drivers.camera.region import Region
from goniometer.errors import ReplyError, SaturatedError

REGION = Region(left=3, top=2, width=4, height=5)


def photometer(**more):
    return Photometer("camera", region=REGION, watts_per_count_per_s=2e-15, saturation_counts=4000, **more)


def frame(level=1000, gain_db=0.0, exposure_s=0.5):
    counts = np.full((12, 16), 3999, np.uint16)
    counts[2:7, 3:7] = level
    return Frame(counts, 12, exposure_s, gain_db, 0.0)


def test_power_is_the_counts_above_black_over_gain_and_exposure():
    np.testing.assert_allclose(photometer().power_w(frame()), 1000 / 0.5 * 2e-15)
    np.testing.assert_allclose(photometer(black_counts=200).power_w(frame()), 800 / 0.5 * 2e-15)
    np.testing.assert_allclose(photometer(black_counts=200).power_w(frame(gain_db=20.0)), 80 / 0.5 * 2e-15)


def test_light_is_the_same_power_in_any_exposure_where_the_black_level_is_known():
    powers_w = [
        photometer(black_counts=150).power_w(frame(150 + int(1000 * time_s), 0.0, time_s)) for time_s in (0.1, 2)
    ]
    np.testing.assert_allclose(powers_w, 1000 * 2e-15)


@pytest.mark.parametrize(
    ("saturated", "most", "is_refused"), [(0, 0.0, False), (1, 0.0, True), (2, 0.1, False), (3, 0.1, True)]
)
def test_so_many_pixels_may_be_saturated_as_the_rig_says(saturated, most, is_refused):
    taken = frame()
    taken.counts[2, 3 : 3 + saturated] = 4000
    if not is_refused:
        np.testing.assert_allclose(photometer(most_saturated=most).power_w(taken), photometer().power_w(frame()))
        return
    with pytest.raises(SaturatedError, match=f"{saturated} of the region's 20 pixels have 4000 counts or more"):
        photometer(most_saturated=most).power_w(taken)


def test_a_full_pixel_counts_less_at_a_lower_gain_and_the_maps_say_so_too():
    """A reading that is valid to the detector must not be a hole in the maps, nor the other way round."""
    sensor = Sensor(SensorNoise(4.0, 0.5), 4000, bits=12)
    for gain_db, limit in ((-6.0206, 1999), (0.0, 4000), (6.0206, 4000)):
        assert sensor.saturation(gain_db) == limit
        assert photometer().power_w(frame(limit - 1, gain_db)) > 0
        with pytest.raises(SaturatedError, match=f"20 of the region's 20 pixels have {limit} counts or more"):
            photometer().power_w(frame(limit, gain_db))


def test_without_a_picture_there_is_no_power():
    with pytest.raises(ReplyError, match="no finished reading"):
        photometer().power_w(None)
