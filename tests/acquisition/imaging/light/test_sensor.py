"""A sensor's figures at other gains, its curve, and figures that cannot be."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.imaging.light.linearity import Linearity
from acquisition.imaging.light.sensor import Sensor
from acquisition.imaging.stokes.pixel_formula import SensorNoise
from goniometer.errors import ConfigurationError


def test_noise_and_electrons_follow_the_gain_and_the_quantization_does_not():
    sensor = Sensor(SensorNoise(2.0, 3.0), 60_000, gain_db=6.0)
    twice = 6.0 + 20 * np.log10(2)
    assert sensor.electrons_per_count(twice) == pytest.approx(1.5)
    assert sensor.electrons_per_count(6.0) == pytest.approx(3.0)
    assert sensor.read_variance(6.0) == pytest.approx(4.0)
    assert sensor.read_variance(twice) == pytest.approx((4.0 - 1 / 12) * 4 + 1 / 12)


def test_rounding_is_added_only_where_it_cannot_be_among_the_noise():
    assert Sensor(SensorNoise(0.0, 3.0), 60_000).read_variance(0.0) == pytest.approx(1 / 12)
    assert Sensor(SensorNoise(0.2, 3.0), 60_000).read_variance(0.0) == pytest.approx(0.04 + 1 / 12)
    assert Sensor(SensorNoise(0.3, 3.0), 60_000).read_variance(0.0) == pytest.approx(0.09)


def test_a_pixel_holds_no_more_charge_at_a_lower_gain_and_a_converter_no_more_counts_at_a_higher():
    sensor = Sensor(SensorNoise(2.0, 3.0), 60_000)
    assert sensor.saturation(6.0) == 60_000
    assert sensor.saturation(-20 * np.log10(2)) == pytest.approx(30_000, abs=1)


def test_counts_are_looked_up_straight_between_rows():
    table = Linearity([(0, 0), (1_000, 1_000), (3_000, 4_000), (65_535, 70_000)])
    counts = np.array([[0, 500, 1_000], [1_500, 2_000, 2_999]], np.uint16)
    assert_allclose(table.true_counts(counts), [[0, 500, 1_000], [1_750, 2_500, 3_998.5]], rtol=1e-6)
    assert_allclose(table.slope_squared(counts[:, :2]), [[1, 1], [2.25, 2.25]], rtol=1e-3)


@pytest.mark.parametrize(
    ("table", "what"),
    [
        ([(0, 0), (100, 90), (100, 95)], r"row 3 \(100.0, 95.0\) does not rise above row 2"),
        ([(0, 0), (100, 90), (200, 90)], r"row 3 \(200.0, 90.0\) does not rise"),
        ([(0, 0), (100, float("nan"))], "row 2 .* does not rise"),
        ([(5, 0), (100, 90)], "begins at 5 counts read"),
        ([(0, 0)], "1 rows say nothing"),
        ([], "0 rows say nothing"),
    ],
)
def test_a_table_that_does_not_rise_or_is_not_whole_is_refused(table, what):
    with pytest.raises(ConfigurationError, match=what):
        Linearity(table)


def test_figures_that_cannot_be_are_named_together():
    with pytest.raises(ConfigurationError) as caught:
        Sensor(SensorNoise(-1.0, 0.0), 4_096, bits=12, linearity=Linearity([(0, 0), (1_000, 1_100)]))
    assert len(caught.value.faults) == 4
    for name in ("saturation_counts: 4096", "read_counts: -1", "electrons_per_count: 0", "linearity: ends at 1000"):
        assert name in str(caught.value)
    with pytest.raises(ConfigurationError, match="bits: 20"):
        Sensor(SensorNoise(1.0, 1.0), 4_000, bits=20)
