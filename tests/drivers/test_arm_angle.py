"""The nearest that two arms come: never farther than any pair of angles in their spans, and attained by one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drivers.arm_angle import nearest_deg
from drivers.collision_zones import ArmsTooClose


def towards(incidence_deg, exit_deg, azimuth_deg):
    """Unit vectors of both arms: the source turned to +x, the detector to -x and then about the normal."""
    source, detector, azimuth = np.radians(np.broadcast_arrays(incidence_deg, exit_deg, azimuth_deg))
    to_source = np.stack([np.sin(source), 0.0 * source, np.cos(source)], axis=-1)
    across = -np.sin(detector)
    to_detector = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(detector)], axis=-1)
    return to_source, to_detector


def between_deg(*angles_deg):
    to_source, to_detector = towards(*angles_deg)
    cross = np.linalg.norm(np.cross(to_source, to_detector), axis=-1)
    return np.degrees(np.arctan2(cross, (to_source * to_detector).sum(axis=-1)))


@pytest.mark.parametrize("seed", range(60))
def test_the_nearest_is_the_least_of_all_pairs(seed):
    random = np.random.default_rng(seed)
    low = random.uniform([-20.0, -120.0, -400.0], [110.0, 120.0, 400.0])
    high = low + random.choice([0.0, 3.0, 40.0, 150.0], 3)
    grid = np.meshgrid(*(np.linspace(*span, 41) for span in zip(low, high, strict=True)))
    least_deg = between_deg(*grid).min()
    found_deg = nearest_deg(*zip(low, high, strict=True))
    spacing_deg = float((high - low).sum()) / 40.0
    assert found_deg <= least_deg + 1e-5
    assert found_deg >= least_deg - spacing_deg - 1e-5


@pytest.mark.parametrize(("source", "detector"), [(30.0, -22.0), (60.0, -55.0), (10.0, 45.0)])
def test_in_plane_it_is_the_sum_of_both_angles_and_half_a_turn_mirrors_the_detector(source, detector):
    spans = (source, source), (detector, detector)
    assert_allclose(nearest_deg(*spans, (0.0, 0.0)), abs(source + detector), atol=1e-6)
    assert_allclose(nearest_deg(*spans, (180.0, 180.0)), abs(source - detector), atol=1e-6)


def test_a_zone_of_the_arms_knows_that_the_detector_is_turned_aside():
    zone = ArmsTooClose(12.0)
    place = {"source_arm": (60.0, 60.0), "detector_arm": (55.0, 65.0)}
    assert not zone.is_entered(place), "on the mirror side"
    assert not zone.is_entered({**place, "detector_azimuth": (-90.0, 90.0)})
    assert zone.is_entered({**place, "detector_azimuth": (-90.0, 180.0)}), "it comes by the source"
    beside = {"source_arm": (60.0, 60.0), "detector_arm": (-60.0, -60.0)}
    assert zone.is_entered({**beside, "detector_azimuth": (-10.0, 10.0)})
    assert zone.is_entered({**beside, "detector_azimuth": (13.8, 13.8)}), "13.8 degrees about the normal are 11.9"
    assert not zone.is_entered({**beside, "detector_azimuth": (14.0, 14.0)})
