"""`goniometer home`: one axis after the other finds its zero, on a way that must be clear."""

import pytest
from numpy.testing import assert_allclose

from goniometer.bench_commands.home import home
from goniometer.bench_commands.move import move
from goniometer.errors import CollisionError, DeviceFaultError, NotConnectedError

POST = {"detector_arm": [-85, -40], "source_arm": [-5, 90]}
"""Something that the detector arm hits, wherever the source arm stands."""


@pytest.mark.parametrize("roles", [(), ("detector_arm", "source_arm")])
def test_axes_are_homed_one_after_the_other(serve, told, roles):
    bench = serve()
    move(bench.rig, "detector_arm", 12, told.append, told.append)
    told.clear()
    together = []
    axes = bench.sim.world.axes.values()
    for axis in axes:
        axis.before_motion.append(lambda now_s: together.append(sum(axis.is_moving(now_s) for axis in axes)))
    home(bench.rig, roles, told.append, told.append, way_is_clear=False)
    assert bench.motor_deg("detector_arm") == 0
    assert max(together) <= 1
    homed = [line.split(":")[0] for line in told if "homed after" in line]
    assert homed == list(roles or ("source_arm", "detector_arm", "sample_azimuth"))
    assert "searches its home position, 180 s at most" in told[0]


def test_homing_tells_that_it_goes_on(serve, told):
    bench = serve()
    move(bench.rig, "sample_azimuth", 170, told.append, told.append)
    home(bench.rig, ("sample_azimuth",), told.append, told.append, way_is_clear=False)
    assert "sample_azimuth: still searching after 5 s" in told


def test_homing_is_refused_while_the_axis_could_touch_something(serve, told):
    bench = serve(zones=[POST])
    move(bench.rig, "detector_arm", 30, told.append, told.append)
    told.clear()
    with pytest.raises(CollisionError, match="from -85 to 85 degrees it can enter a collision zone: source_arm at -5"):
        home(bench.rig, ("detector_arm", "source_arm"), told.append, told.append, way_is_clear=False)
    assert told == []
    assert_allclose(bench.motor_deg("detector_arm"), 30, atol=0.001)


def test_homing_is_allowed_where_the_whole_travel_is_free(serve, told):
    bench = serve(zones=[POST])
    move(bench.rig, "detector_arm", 30, told.append, told.append)
    home(bench.rig, ("source_arm", "sample_azimuth"), told.append, told.append, way_is_clear=False)
    assert sum("homed after" in line for line in told) == 2


def test_an_axis_that_is_not_homed_may_stand_anywhere(serve, told, monkeypatch):
    bench = serve(zones=[POST])
    monkeypatch.setattr("drivers.newport_esp301.stage.Esp301Stage.is_homed", lambda stage: stage.name != "detector_arm")
    with pytest.raises(CollisionError, match="detector_arm anywhere from -85° to 85°"):
        home(bench.rig, ("source_arm",), told.append, told.append, way_is_clear=False)
    assert bench.motor_deg("source_arm") == 0


def test_a_person_may_say_that_the_way_is_clear(serve, told):
    bench = serve(zones=[POST])
    home(bench.rig, ("detector_arm",), told.append, told.append, way_is_clear=True)
    assert "detector_arm: homed after" in told[-1]


def test_a_stage_that_has_not_found_its_zero_is_an_error(serve, told, monkeypatch):
    bench = serve()
    monkeypatch.setattr("drivers.newport_esp301.stage.Esp301Stage.is_homed", lambda stage: False)
    with pytest.raises(DeviceFaultError, match="the search has ended, and that the zero is not known"):
        home(bench.rig, ("source_arm",), told.append, told.append, way_is_clear=False)


def test_homing_needs_the_axes_that_it_could_touch_unless_a_person_has_looked(beside_the_table, told):
    beside_the_table.switch_off("sample_stage")
    with pytest.raises(NotConnectedError, match="sample_stage: port"):
        home(beside_the_table.rig, ["source_arm"], told.append, told.append, way_is_clear=False)
    home(beside_the_table.rig, ["source_arm"], told.append, told.append, way_is_clear=True)
    home(beside_the_table.rig, ["detector_arm"], told.append, told.append, way_is_clear=False)


def test_an_axis_that_stands_outside_its_limits_could_enter_what_lies_on_its_way_back(serve, told):
    bench = serve()
    bench.change_axis("source_arm", limits_deg=[-40, 90])
    move(bench.rig, "source_arm", -30, told.append, told.append)
    bench.change_axis("source_arm", limits_deg=[-5, 90])
    home(bench.rig, ["source_arm"], told.append, told.append, way_is_clear=False)
    bench.change_axis("source_arm", limits_deg=[-40, 90])
    move(bench.rig, "source_arm", -30, told.append, told.append)
    bench.change_axis("source_arm", limits_deg=[-5, 90])
    bench.set_zones({"source_arm": [-20, -10]})
    with pytest.raises(CollisionError, match="the way to its home position is not known"):
        home(bench.rig, ["source_arm"], told.append, told.append, way_is_clear=False)
    assert_allclose(bench.motor_deg("source_arm"), -30, atol=0.001)
