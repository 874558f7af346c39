"""Alarms: `goniometer home` resets those that keep the axes that it homes from homing, and nothing else resets any."""

import pytest
from numpy.testing import assert_allclose

from drivers.modbus.port import ModbusPort
from drivers.modbus.unit import ModbusUnit
from goniometer.bench_commands.home import home
from goniometer.bench_commands.move import move
from goniometer.bench_commands.read import read
from goniometer.bench_commands.stop import stop
from goniometer.errors import CollisionError, DeviceFaultError
from sim_devices.faults.known import one_fault


def lose_home(bench):
    bench.sim.faults.switch_on(one_fault.validate_python({"fault": "lost_home", "axis": "sample_azimuth"}))
    bench.sim.clock.sleep(0.1)


def set_home_at_the_drive(bench):
    """What a person does there once the axis stands at its mark; the alarm stays on."""
    port = ModbusPort(bench.sim.addresses["sample_stage"].tcp, device="a person")
    ModbusUnit(port, 1, device="a person").write_int32(0x018A, (1,))
    port.close()


ALARM_RESET = bytes.fromhex("01 10 01 80 00 02 04 00 00 00 01 37 9F")


def test_homing_resets_the_alarm_that_home_is_lost_and_says_so(serve_shipped, told, tmp_path, sent):
    bench = serve_shipped("iron")
    move(bench.rig, "sample_azimuth", 20, told.append, told.append)
    lose_home(bench)
    set_home_at_the_drive(bench)
    told.clear()
    home(bench.rig, ["sample_azimuth"], told.append, told.append, way_is_clear=False, trace=tmp_path / "wire.log")
    assert "alarm 0x4A, home is not set, which homing resets" in told[0]
    assert "homed after" in told[-1]
    assert sent(tmp_path / "wire.log")["sample_stage"].count(ALARM_RESET) == 1
    assert_allclose(bench.motor_deg("sample_azimuth"), 20, atol=0.03)
    move(bench.rig, "sample_azimuth", 5, told.append, told.append)
    assert_allclose(bench.motor_deg("sample_azimuth"), 25, atol=0.03)


def test_a_drive_without_a_home_position_is_not_moved_and_the_alarm_stays(serve_shipped, told):
    bench = serve_shipped("iron")
    move(bench.rig, "sample_azimuth", 20, told.append, told.append)
    lose_home(bench)
    with pytest.raises(DeviceFaultError, match=r"0x4A, home is not set.* if it comes back, set the home position at"):
        home(bench.rig, ["sample_azimuth"], told.append, told.append, way_is_clear=False)
    assert_allclose(bench.motor_deg("sample_azimuth"), 20, atol=0.03)
    with pytest.raises(DeviceFaultError, match="0x4A, home is not set"):
        move(bench.rig, "sample_azimuth", 5, told.append, told.append)


def test_no_other_command_resets_it(serve_shipped, told, tmp_path, sent):
    bench, log = serve_shipped("iron"), tmp_path / "wire.log"
    lose_home(bench)
    for command in (
        lambda: move(bench.rig, "sample_azimuth", 20, told.append, told.append, trace=log),
        lambda: read(bench.rig, 0.1, None, 1, told.append, trace=log),
    ):
        with pytest.raises(DeviceFaultError, match=r"0x4A, home is not set.* goniometer home --axis sample_azimuth"):
            command()
    stop(bench.rig, told.append, trace=log)
    assert ALARM_RESET not in sent(log)["sample_stage"]


def test_homing_another_axis_does_not_reset_it(beside_the_table, told):
    lose_home(beside_the_table)
    with pytest.raises(DeviceFaultError, match="0x4A, home is not set"):
        home(beside_the_table.rig, ["source_arm"], told.append, told.append, way_is_clear=False)


def test_an_alarm_that_homing_does_not_cure_stays(serve_shipped, told):
    bench = serve_shipped("iron")
    bench.sim.faults.switch_on(one_fault.validate_python({"fault": "limit_hit", "axis": "sample_azimuth"}))
    with pytest.raises(DeviceFaultError, match="0x66, hardware over-travel"):
        move(bench.rig, "sample_azimuth", 20, told.append, told.append)
    with pytest.raises(DeviceFaultError, match=r"0x66, hardware over-travel.* remove the cause, reset the alarm at"):
        home(bench.rig, ["sample_azimuth"], told.append, told.append, way_is_clear=False)


def test_after_the_alarm_the_axis_may_stand_anywhere_until_it_is_homed(beside_the_table, told):
    """The drive forgets where home is, and with it what its position means: 0 is not out of the other axis' way."""
    lose_home(beside_the_table)
    set_home_at_the_drive(beside_the_table)
    with pytest.raises(CollisionError, match="sample_azimuth anywhere from -180° to 180°"):
        home(beside_the_table.rig, ["source_arm", "sample_azimuth"], told.append, told.append, way_is_clear=False)
    home(beside_the_table.rig, ["sample_azimuth", "source_arm"], told.append, told.append, way_is_clear=False)


LEC_RESET = bytes.fromhex("01 05 00 1B FF 00 FC 3D")


def table_with_an_alarm(serve_shipped, told):
    """A LEC controller whose protection has tripped."""
    bench = serve_shipped("iron_thorlabs")
    home(bench.rig, ["sample_azimuth"], told.append, told.append, way_is_clear=False)
    bench.sim.world.devices["table"].trip(bench.sim.clock.now())
    told.clear()
    return bench


def test_the_alarm_of_a_table_is_refused_with_what_to_do(serve_shipped, told, tmp_path, sent):
    bench, log = table_with_an_alarm(serve_shipped, told), tmp_path / "wire.log"
    for command in (
        lambda: move(bench.rig, "sample_azimuth", 5, told.append, told.append, trace=log),
        lambda: read(bench.rig, 0.1, None, 1, told.append, trace=log),
    ):
        with pytest.raises(
            DeviceFaultError, match=r"has an alarm.* cause, then: goniometer home --axis sample_azimuth"
        ):
            command()
    assert LEC_RESET not in [write for writes in sent(log).values() for write in writes]


def test_homing_resets_the_alarm_of_a_table_and_says_so(serve_shipped, told, tmp_path, sent):
    bench, log = table_with_an_alarm(serve_shipped, told), tmp_path / "wire.log"
    home(bench.rig, ["sample_azimuth"], told.append, told.append, way_is_clear=False, trace=log)
    assert "an alarm, which was reset" in told[0]
    assert "homed after" in told[-1]
    assert [write for writes in sent(log).values() for write in writes].count(LEC_RESET) == 1
    move(bench.rig, "sample_azimuth", 5, told.append, told.append)
    assert_allclose(bench.motor_deg("sample_azimuth"), 5, atol=0.03)
