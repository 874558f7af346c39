"""Counts follow the sheet's formula; each effect of the sensor has its formula's mean and spread, and a seed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import ValidationError

from sim_devices.camera.sensor import Sensor, SensorParts

HEIGHT, WIDTH = 150, 200


def sensor(seed=3, **parts):
    return Sensor(SensorParts.model_validate(parts), HEIGHT, WIDTH, 1e-15, seed)


def light(counts_per_s):
    return np.full((HEIGHT, WIDTH), counts_per_s * 1e-15)


def counts(of, power_w, exposure_s=1.0, gain_db=0.0, bits=16, number=1):
    return of.counts(power_w, exposure_s, gain_db, bits, number).astype(float)


@pytest.mark.parametrize(("bits", "kind"), [(8, np.uint8), (10, np.uint16), (12, np.uint16), (16, np.uint16)])
@pytest.mark.parametrize("gain_db", [0.0, 6.0])
def test_an_ideal_sensor_counts_and_ends_where_its_converter_does(bits, kind, gain_db):
    ramp_w = np.linspace(0, 1e5, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH) * 1e-15
    found = sensor().counts(ramp_w, 0.7, gain_db, bits, 1)
    assert found.dtype == kind
    expected = np.round(ramp_w * 0.7 / 1e-15 * 10 ** (gain_db / 20))
    assert_array_equal(found, np.minimum(expected, 2**bits - 1))


def test_in_the_dark_there_is_the_black_level_and_the_dark_current_of_the_exposure():
    of = sensor(dark_counts=64.0, dark_counts_per_s=100.0)
    assert_array_equal(counts(of, None, exposure_s=0.5), 114)
    # the amplifier's gain is before the black level
    assert_array_equal(counts(of, None, exposure_s=0.5, gain_db=20.0), 564)


@pytest.mark.parametrize("mean", [2.0, 20.0, 39.0, 41.0, 400.0, 20_000.0])
def test_counted_electrons_have_the_variance_of_their_number(mean):
    found = counts(sensor(electrons_per_count=2.5), light(mean))
    assert found.mean() == pytest.approx(mean, abs=6 * np.sqrt(mean / 2.5 / found.size))
    assert found.var() == pytest.approx(mean / 2.5 + 1 / 12, rel=0.05)


def test_electrons_of_the_dark_current_are_counted_too():
    found = counts(sensor(electrons_per_count=0.5, dark_counts_per_s=1000.0), None, exposure_s=2.0)
    assert found.var() == pytest.approx(4000.0, rel=0.05)


def test_noise_of_reading_out_does_not_hang_on_the_light_and_grows_with_the_gain():
    of = sensor(read_counts=5.0, dark_counts=1000.0)
    assert counts(of, None).std() == pytest.approx(5.0, rel=0.03)
    assert counts(of, light(5000.0)).std() == pytest.approx(5.0, rel=0.03)
    assert counts(of, None, gain_db=12.0).std() == pytest.approx(5.0 * 10**0.6, rel=0.03)


def test_pixels_differ_by_a_fixed_pattern_that_the_dark_does_not_have():
    of = sensor(prnu=0.02, dark_counts=500.0)
    one, other = counts(of, light(10_000.0), number=1), counts(of, light(20_000.0), number=2)
    assert (one.std() / 10_000) == pytest.approx(0.02, rel=0.03)
    assert_allclose((other - 500) / (one - 500), 2.0, rtol=2e-4)
    assert_array_equal(counts(of, None), 500)


def test_hot_pixels_fill_with_time_and_dead_ones_see_nothing():
    of = sensor(hot_pixels=7, hot_counts_per_s=2000.0, dead_pixels=5, dark_counts=10.0)
    dark, lit = counts(of, None, exposure_s=0.5), counts(of, light(4000.0), exposure_s=0.5)
    assert np.count_nonzero(dark != 10) == 7
    assert_array_equal(dark[tuple(of.hot.T)], 1010)
    assert np.count_nonzero(lit == 10) == 5
    assert_array_equal(lit[tuple(of.dead.T)], 10)


def test_a_bent_response_misses_the_share_it_is_given_and_never_turns_back():
    of = sensor(nonlinearity={"relative_loss": 0.1, "at_counts": 4000.0})
    assert_array_equal(counts(of, light(4000.0)), 3600)
    assert_array_equal(counts(of, light(2000.0)), 1900)
    assert_array_equal(counts(of, light(20_000.0)), 10_000)
    assert_array_equal(counts(of, light(60_000.0)), 10_000)


@pytest.mark.parametrize("mean", [3.0, 3000.0])
def test_noise_hangs_on_seed_and_number_of_the_frame_alone(mean):
    parts = {"electrons_per_count": 1.0, "read_counts": 3.0, "dark_counts": 50.0, "prnu": 0.01, "hot_pixels": 20}
    one, again, elsewhere = sensor(**parts), sensor(**parts), sensor(seed=4, **parts)
    counts(again, light(77.0), number=1)
    assert_array_equal(counts(one, light(mean), number=2), counts(again, light(mean), number=2))
    assert np.any(counts(one, light(mean), number=2) != counts(one, light(mean), number=3))
    assert np.any(counts(one, light(mean), number=2) != counts(elsewhere, light(mean), number=2))
    assert np.any(one.hot != elsewhere.hot)


def test_an_effect_that_is_not_named_is_not_there():
    assert len(sensor()._steps) == 1
    assert len(sensor(dark_counts=1.0)._steps) == 2


@pytest.mark.parametrize("part", [{"prnu": 0.0}, {"dead_pixels": 0}, {"blooming": 1}, {"read_counts": float("nan")}])
def test_parts_that_mean_nothing_are_refused(part):
    with pytest.raises(ValidationError):
        SensorParts.model_validate(part)


def test_more_hot_pixels_than_pixels_are_refused():
    with pytest.raises(ValueError, match="30001 dead pixels, and the sensor has 30000 pixels"):
        sensor(dead_pixels=30_001)
