"""A path is free exactly when no place on it lies in a zone."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.collision_zones import ArmsTooClose, Box, entered, free_order, orders


def place(source_deg, detector_deg, azimuth_deg=0.0):
    angles = {"source_arm": source_deg, "detector_arm": detector_deg, "sample_azimuth": azimuth_deg}
    return {role: (angle_deg, angle_deg) for role, angle_deg in angles.items()}


@pytest.mark.parametrize(
    ("source_deg", "detector_deg", "touches"),
    [(60, 60, False), (60, -60, True), (60, -45, False), (60, -45.1, True), (60, -75, False), (0, 0, True)],
)
def test_arms_meet_where_the_detector_looks_back_at_the_source(source_deg, detector_deg, touches):
    assert ArmsTooClose(15).is_entered(place(source_deg, detector_deg)) == touches


def test_a_box_needs_every_axis_within_its_range():
    zone = Box({"detector_arm": (80, 100), "sample_azimuth": (40, 50)})
    assert zone.is_entered(place(0, 90, 45))
    assert zone.is_entered(place(0, 80, 50))
    assert not zone.is_entered(place(0, 90, 39.9))
    assert not zone.is_entered(place(0, 79.9, 45))


def test_a_path_is_free_exactly_when_no_place_on_it_is_in_a_zone():
    rng = np.random.default_rng(3)
    zones = (
        ArmsTooClose(12),
        Box({"detector_arm": (70, 95)}),
        Box({"source_arm": (-90, -20), "sample_azimuth": (10, 60)}),
    )
    found = {True: 0, False: 0}
    for _ in range(300):
        ends = rng.uniform(-100, 100, (3, 2))
        spans = dict(zip(("source_arm", "detector_arm", "sample_azimuth"), map(sorted, ends), strict=True))
        grid = np.meshgrid(*(np.linspace(*span, 25) for span in spans.values()), indexing="ij")
        source, detector, azimuth = grid
        inside = (abs(source + detector) < 12) | ((detector >= 70) & (detector <= 95))
        inside |= (source >= -90) & (source <= -20) & (azimuth >= 10) & (azimuth <= 60)
        is_entered = entered(zones, spans) is not None
        found[is_entered] += 1
        # a grid may miss the tip of a zone, but never find one that is not there
        assert is_entered or not inside.any()
        widest_deg = max(high - low for low, high in spans.values()) / 24
        close = (abs(source + detector) < 12 + 2 * widest_deg) | (
            (detector >= 70 - widest_deg) & (detector <= 95 + widest_deg)
        )
        close |= (
            (source >= -90 - widest_deg)
            & (source <= -20 + widest_deg)
            & (azimuth >= 10 - widest_deg)
            & (azimuth <= 60 + widest_deg)
        )
        assert close.any() or not is_entered
    assert min(found.values()) > 20


def test_all_at_once_comes_first_then_one_after_the_other():
    assert list(orders(("a", "b"))) == [(("a", "b"),), (("a",), ("b",)), (("b",), ("a",))]
    assert list(orders(("a",))) == [(("a",),)]
    assert list(orders(())) == []


def test_arms_that_would_meet_halfway_go_one_after_the_other():
    zones = (ArmsTooClose(15),)
    here = {"source_arm": 60.0, "detector_arm": -20.0, "sample_azimuth": 0.0}
    ways = {"source_arm": (60.0, 20.0), "detector_arm": (-20.0, 60.0)}
    assert free_order(zones, here, ways) == (("detector_arm",), ("source_arm",))
    assert free_order((), here, ways) == (("source_arm", "detector_arm"),)


def test_a_way_that_no_order_makes_free_is_refused():
    zones = (ArmsTooClose(15),)
    here = {"source_arm": 60.0, "detector_arm": -20.0, "sample_azimuth": 0.0}
    assert free_order(zones, here, {"detector_arm": (-20.0, -80.0)}) is None
    assert free_order(zones, here, {}) == ()


def test_the_turning_point_of_an_approach_belongs_to_the_way():
    zones = (Box({"detector_arm": (-80, -62)}),)
    here = {"source_arm": 0.0, "detector_arm": 0.0, "sample_azimuth": 0.0}
    assert free_order(zones, here, {"detector_arm": (0.0, -60.0)}) == (("detector_arm",),)
    assert free_order(zones, here, {"detector_arm": (0.0, -62.0, -60.0)}) is None


@pytest.mark.parametrize(
    ("source_deg", "detector_deg", "touches"),
    [(200, 160, True), (-200, -160, True), (180, -180, True), (200, 174.9, True), (200, 175, False), (350, -60, False)],
)
def test_arms_meet_also_a_turn_away(source_deg, detector_deg, touches):
    assert ArmsTooClose(15).is_entered(place(source_deg, detector_deg)) == touches


@pytest.mark.parametrize(("azimuth_deg", "touches"), [(-5, True), (355, True), (715, True), (-10.1, False), (5, False)])
def test_a_box_reaches_as_far_as_its_angles_a_turn_away(azimuth_deg, touches):
    assert Box({"sample_azimuth": (350, 360)}).is_entered(place(0, 0, azimuth_deg)) == touches


def test_whole_turns_of_any_axis_change_nothing():
    rng = np.random.default_rng(4)
    roles = ("source_arm", "detector_arm", "sample_azimuth")
    zones = (ArmsTooClose(40), Box({"detector_arm": (100, 190)}), Box({"source_arm": (-90, 20), roles[2]: (10, 160)}))
    found = {True: 0, False: 0}
    for _ in range(300):
        spans = {role: tuple(np.sort(rng.uniform(-180, 180, 2) * rng.uniform(0, 1))) for role in roles}
        turned = {role: tuple(np.add(span, 360 * rng.integers(-3, 4))) for role, span in spans.items()}
        for zone in zones:
            is_entered = zone.is_entered(spans)
            found[is_entered] += 1
            assert zone.is_entered(turned) == is_entered
    assert min(found.values()) > 100


def test_an_axis_that_turns_all_the_way_round_passes_everything():
    assert Box({"sample_azimuth": (350, 351)}).is_entered({"sample_azimuth": (-8.5, 351.5)})
    assert not Box({"sample_azimuth": (350, 351)}).is_entered({"sample_azimuth": (-8.5, 349.5)})
    assert ArmsTooClose(1).is_entered({"source_arm": (2, 2), "detector_arm": (0, 357.5)})
    assert not ArmsTooClose(1).is_entered({"source_arm": (2, 2), "detector_arm": (0, 357)})
