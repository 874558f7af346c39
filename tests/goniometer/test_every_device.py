"""Every stage's driver against its simulated device, through rig and scene."""

from __future__ import annotations

import copy

import pytest
from numpy.testing import assert_allclose

from goniometer.errors import DeviceError, DeviceFaultError, NotConnectedError


def axis(low=-180, high=180, speed=20, acceleration=80, **more):
    return {
        "limits_deg": [low, high],
        "velocity_deg_s": speed,
        "acceleration_deg_s2": acceleration,
        "settle_s": 0.05,
        "tolerance_deg": 0.06,
    } | more


ARMS = {"source_arm": axis(-5, 90, axis=1), "detector_arm": axis(-85, 85, axis=2)}


def kind(driver, turning, scene, **rig):
    """The stage under the sample, in the rig and in the scene."""
    entry = {"driver": driver, "axes": {"sample_azimuth": turning}}
    return {"stage": entry | rig}, {"stage": {"type": driver} | scene}


def apt(stage, **turning):
    scene = {"stage": stage, "axes": {1: "sample_azimuth"}}
    return kind("thorlabs_apt", axis(**turning), scene, stage=stage)


def lec(framing, *, alarm_is_one):
    scene = {"unit": 3, "axis": "sample_azimuth", "framing": framing, "alarm_is_one": alarm_is_one}
    return kind("smc_lec", axis(), scene, unit=3, alarm_is_one=alarm_is_one)


def az(framing):
    scene = {"unit": 3, "axis": "sample_azimuth", "framing": framing, "step_deg": 0.02}
    return kind("oriental_az", axis(steps_per_deg=50), scene, unit=3)


def esp301():
    scene = {"axes": {1: "source_arm", 2: "detector_arm", 3: "sample_azimuth"}}
    rig, scene = kind("newport_esp301", axis(axis=3), scene)
    rig["stage"]["axes"] |= ARMS
    return rig | {"arms": None}, scene | {"arms": None}


FORGETFUL = {
    "K10CR1": apt("K10CR1", speed=10, acceleration=20),
    "PRM1Z8": apt("PRM1Z8"),
    "ELL14": kind("thorlabs_elliptec", axis(speed=430, acceleration=8600), {"axis": "sample_azimuth"}),
    "LEC": lec("rtu", alarm_is_one=True),
    "LEC, alarm 0, Modbus TCP": lec("tcp", alarm_is_one=False),
}
STAGES = FORGETFUL | {
    "ESP301": esp301(),
    "AZ": az("rtu"),
    "AZ, Modbus TCP": az("tcp"),
}


@pytest.mark.parametrize("which", FORGETFUL)
def test_a_stage_that_was_just_switched_on_is_moved_only_after_homing(open_room, which):
    room = open_room(*FORGETFUL[which], start_deg={"sample_azimuth": 20.0})
    azimuth = room.devices.sample_azimuth
    assert not azimuth.is_homed()
    with pytest.raises(DeviceFaultError, match="sample_azimuth: the stage does not know where its zero is"):
        azimuth.start_move(10)
    assert room.true_deg() == 20.0
    room.home(azimuth)
    assert azimuth.is_homed()
    assert_allclose([azimuth.position_deg(), room.true_deg() % 360.0 % 359.99], 0.0, atol=0.02)


@pytest.mark.parametrize("which", STAGES)
def test_a_stage_goes_where_it_is_sent_and_says_so(open_room, which):
    room = open_room(*STAGES[which])
    azimuth = room.devices.sample_azimuth
    room.home(azimuth)
    for angle_deg in (45, 45, 30.5, -3, 0, 170, -170):
        room.move(azimuth, angle_deg)
        assert_allclose([azimuth.position_deg(), room.true_deg()], angle_deg, atol=0.02)


@pytest.mark.parametrize("which", STAGES)
def test_a_question_takes_as_long_as_plans_are_made_with(load, open_room, which):
    planned_s = load(*STAGES[which]).rig.devices["stage"].timing()["sample_azimuth"].exchange_s
    room = open_room(*STAGES[which])
    begun_s = room.clock.now()
    for _ in range(20):
        room.devices.sample_azimuth.position_deg()
    assert_allclose((room.clock.now() - begun_s) / 20, planned_s, rtol=0.3)


@pytest.mark.parametrize("which", STAGES)
def test_a_stage_stopped_on_its_way_rests_before_it_is_said_to(open_room, which):
    room = open_room(*STAGES[which])
    azimuth, true = room.devices.sample_azimuth, room.world.axes["sample_azimuth"]
    room.home(azimuth)
    azimuth.start_move(150)
    room.poll(azimuth, 0.25)
    assert true.is_moving(room.clock.now())
    azimuth.stop()
    room.rest(azimuth)
    assert not true.is_moving(room.clock.now())
    assert_allclose(azimuth.position_deg(), room.true_deg(), atol=0.02)
    room.move(azimuth, -20)
    assert_allclose(room.true_deg(), -20, atol=0.02)


@pytest.mark.parametrize("which", STAGES)
def test_a_stage_is_where_it_was_after_the_port_was_opened_afresh(open_room, which):
    room = open_room(*STAGES[which])
    azimuth = room.devices.sample_azimuth
    room.home(azimuth)
    room.move(azimuth, 25)
    azimuth.stop()
    azimuth._stage.reconnect()
    assert azimuth.connect() == ()
    assert azimuth.is_homed()
    assert_allclose(azimuth.position_deg(), 25, atol=0.02)
    room.move(azimuth, -10)
    assert_allclose(room.true_deg(), -10, atol=0.02)


@pytest.mark.parametrize("which", STAGES)
def test_a_port_opened_afresh_on_the_way_never_leads_elsewhere(open_room, which):
    room = open_room(*STAGES[which])
    azimuth = room.devices.sample_azimuth
    room.home(azimuth)
    azimuth.start_move(60)
    room.poll(azimuth, 0.2)
    azimuth._stage.reconnect()
    try:
        room.rest(azimuth)
    except NotConnectedError as error:
        assert "opened afresh" in str(error)  # noqa: PT017 (only a stage that answers at the end of a motion raises)
        room.rest(azimuth)
    assert_allclose([azimuth.position_deg(), room.true_deg()], 60, atol=0.02)


@pytest.mark.parametrize("which", FORGETFUL)
@pytest.mark.usefixtures("no_real_grace")
def test_a_stage_switched_off_on_its_way_is_an_error_and_has_no_home(open_room, which):
    room = open_room(*FORGETFUL[which])
    azimuth = room.devices.sample_azimuth
    room.home(azimuth)
    azimuth.start_move(150)
    room.poll(azimuth, 0.25)
    stage = room.world.devices["stage"]
    controller = getattr(stage, "_units", {3: stage})[3]  # behind a gateway, or itself
    controller.power_cycle(room.clock.now())
    with pytest.raises(DeviceError, match="sample_azimuth: "):
        room.rest(azimuth)
    with pytest.raises(DeviceFaultError, match="does not know where its zero is"):
        azimuth.start_move(0)


@pytest.fixture
def no_real_grace(monkeypatch):
    monkeypatch.setattr("drivers.clock.Deadline._REAL_GRACE_S", 0.0)


@pytest.mark.parametrize("which", ["K10CR1", "PRM1Z8", "LEC", "AZ", "ESP301"])
def test_play_is_taken_out_by_coming_from_below(open_room, which):
    rig, scene = copy.deepcopy(STAGES[which])
    rig["stage"]["axes"]["sample_azimuth"]["backlash_deg"] = 1.0
    room = open_room(rig, scene)
    azimuth = room.devices.sample_azimuth
    room.home(azimuth)
    for angle_deg in (40, 20, 21, 20.5, -30):
        room.move(azimuth, angle_deg)
        last = room.world.axes["sample_azimuth"].profile(room.clock.now())
        assert last.start_deg < angle_deg
        assert_allclose(last.end_deg, angle_deg, atol=0.02)


def test_three_bays_of_a_rack_move_at_once_and_one_takes_the_shorter_way_round(open_room):
    bays = {
        "source_arm": axis(-5, 90, bay=1),
        "detector_arm": axis(-85, 85, bay=2),
        "sample_azimuth": axis(-360, 360, bay=3, wraps=True),
    }
    rack = {"driver": "thorlabs_apt", "stage": "HDR50", "axes": bays}
    scene = {
        "type": "thorlabs_apt",
        "stage": "HDR50",
        "axes": {1: "source_arm", 2: "detector_arm", 3: "sample_azimuth"},
    }
    room = open_room({"arms": rack, "stage": None}, {"arms": scene, "stage": None})
    movers = tuple(room.devices.axes.values())
    room.home(*movers)
    for mover, angle_deg in zip(movers, (60, -40, 170), strict=True):
        mover.start_move(angle_deg)
    assert room.rest(*movers) < 170 / 20 + 20 / 80 + 0.2
    assert_allclose([mover.position_deg() for mover in movers], [60, -40, 170], atol=1e-3)
    room.move(room.devices.sample_azimuth, -170)
    assert_allclose(room.devices.sample_azimuth.position_deg(), -170, atol=1e-3)
    assert_allclose(room.true_deg(), 190, atol=1e-3)


@pytest.mark.parametrize("framing", ["rtu", "tcp"])
def test_drives_of_two_makes_share_a_modbus_line(open_room, framing):
    def drive(number, role):
        entry = {"driver": "oriental_az", "unit": number, "baudrate": 38400, "parity": "none"}
        return entry | {"axes": {role: axis(-85, 85, steps_per_deg=50)}}

    def simulated(kind, number, role, **more):
        return {"type": kind, "unit": number, "axis": role, "framing": framing, "line": "rs485"} | more

    rig = {
        "arms": None,
        "source": drive(1, "source_arm"),
        "detector": drive(2, "detector_arm"),
        "stage": {"driver": "smc_lec", "unit": 3, "axes": {"sample_azimuth": axis()}},
    }
    scene = {
        "arms": None,
        "source": simulated("oriental_az", 1, "source_arm", step_deg=0.02),
        "detector": simulated("oriental_az", 2, "detector_arm", step_deg=0.02),
        "stage": simulated("smc_lec", 3, "sample_azimuth"),
    }
    room = open_room(rig, scene)
    assert len({room.addresses[name].tcp for name in ("source", "detector", "stage")}) == 1
    room.home(room.devices.sample_azimuth)
    movers = tuple(room.devices.axes.values())
    for mover, angle_deg in zip(movers, (60, -40, 45), strict=True):
        mover.start_move(angle_deg)
    assert room.rest(*movers) < 60 / 20 + 20 / 80 + 0.3
    assert [mover.position_deg() for mover in movers] == [60, -40, 45]
