"""The bench commands know an axis that turns the detector arm out of the plane of incidence."""

import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose

from goniometer.bench_commands.align import align
from goniometer.bench_commands.home import home
from goniometer.bench_commands.move import move
from goniometer.bench_commands.read import read
from goniometer.bench_commands.stop import stop
from goniometer.cli import cli
from goniometer.errors import CollisionError, ConfigurationError, LimitError


@pytest.fixture
def bench(serve_shipped):
    return serve_shipped("iron_out_of_plane")


def test_it_is_homed_moved_and_read(bench, told):
    move(bench.rig, "detector_azimuth", -25.0, told.append, told.append)
    assert_allclose(bench.motor_deg("detector_azimuth"), -25.0, atol=0.005)
    found = read(bench.rig, 0.03, None, 1, told.append)
    assert_allclose(found.positions_deg["detector_azimuth"], -25.0, atol=0.005)
    home(bench.rig, ["detector_azimuth"], told.append, told.append, way_is_clear=False)
    assert bench.motor_deg("detector_azimuth") == pytest.approx(0.0, abs=0.005)
    assert any(line.startswith("detector_azimuth: homed") for line in told)
    told.clear()
    home(bench.rig, [], told.append, told.append, way_is_clear=False)
    homed = [line.partition(":")[0] for line in told if "homed after" in line]
    assert homed == ["source_arm", "detector_arm", "sample_azimuth", "detector_azimuth"]


def test_the_command_line_takes_its_name(bench):
    result = CliRunner().invoke(cli, ["move", "--rig", str(bench.rig), "detector_azimuth", "-15"])
    assert result.exit_code == 0, result.output
    assert_allclose(bench.motor_deg("detector_azimuth"), -15.0, atol=0.005)


def test_it_does_not_go_beyond_its_limits_nor_into_a_zone(bench, told):
    with pytest.raises(LimitError, match="detector_azimuth"):
        move(bench.rig, "detector_azimuth", 95.0, told.append, told.append)
    for axis, angle_deg in (("source_arm", 40.0), ("detector_azimuth", 60.0), ("detector_arm", -40.0)):
        move(bench.rig, axis, angle_deg, told.append, told.append)
    bench.set_zones({"arms_closer_than_deg": 12})
    with pytest.raises(CollisionError, match="source arm and detector arm closer than 12 degrees"):
        move(bench.rig, "detector_azimuth", 0.0, told.append, told.append)
    assert_allclose(bench.motor_deg("detector_azimuth"), 60.0, atol=0.005)
    move(bench.rig, "detector_azimuth", 30.0, told.append, told.append)
    bench.set_zones({"detector_azimuth": [-90, 20], "detector_arm": [-50, -30]})
    with pytest.raises(CollisionError, match="detector_azimuth at -90 to 20 degrees"):
        move(bench.rig, "detector_azimuth", 0.0, told.append, told.append)


def test_it_is_stopped_with_the_others(bench, told):
    bench.sim.world.axes["detector_azimuth"].move(
        80.0, bench.sim.clock.now(), velocity_deg_s=1.0, acceleration_deg_s2=10.0, deceleration_deg_s2=10.0
    )
    assert bench.is_moving()
    assert stop(bench.rig, told.append)
    assert any("detector_azimuth" in line for line in told)


def test_an_arm_is_not_aligned_out_of_the_plane_where_the_mirror_direction_is_not(bench, told):
    move(bench.rig, "detector_azimuth", 10.0, told.append, told.append)
    move(bench.rig, "source_arm", 30.0, told.append, told.append)
    before_deg = bench.motor_deg("detector_arm")
    with pytest.raises(ConfigurationError, match="mirror direction lies in the plane of incidence, at 0"):
        align(bench.rig, "detector_arm", 25.0, 35.0, None, told.append, store=False)
    assert bench.motor_deg("detector_arm") == before_deg
