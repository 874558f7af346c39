from __future__ import annotations

import socket
import struct

import pytest

from drivers.axis import Axis
from drivers.modbus.port import ModbusPort
from drivers.modbus.unit import ModbusUnit
from drivers.oriental_az.stage import OrientalAz
from drivers.travel import Travel
from goniometer.errors import DeviceFaultError, LimitError, NotConnectedError, ReplyError, ReplyTimeoutError

# Published frames: a move to 8500 steps at 2000 Hz and 1000 kHz/s, its answer, a position, STOP, data no. 0 = -1000.
MOVE = bytes.fromhex(
    "01 10 00 58 00 10 20 00000000 00000001 00002134 000007D0 000F4240 000F4240 000003E8 00000001 41 81"
)
MOVE_TAKEN = bytes.fromhex("01 10 00 58 00 10 40 16")
POSITION = bytes.fromhex("01 03 00 CC 00 02 04 34")
AT_8500 = bytes.fromhex("01 03 04 00 00 21 34 E3 B4")
STOP = bytes.fromhex("01 06 00 7D 00 20 18 0A")
MINUS_1000 = bytes.fromhex("01 10 18 02 00 02 04 FF FF FC 18 99 58")
MINUS_1000_TAKEN = bytes.fromhex("01 10 18 02 00 02 E6 A8")

READY, MOVE_BIT, IN_POSITION = 1 << 5, 1 << 13, 1 << 14


def with_crc(frame: bytes) -> bytes:
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return frame + struct.pack("<H", crc)


def read(address: int, registers: int) -> bytes:
    return with_crc(struct.pack(">BBHH", 1, 3, address, registers))


def answer(*items: int) -> bytes:
    return with_crc(struct.pack(f">BBB{len(items)}i", 1, 3, 4 * len(items), *items))


def split(received: bytes) -> tuple[bytes, bytes, bytes]:
    """Split off one request: command, whether there is one, rest."""
    length = 9 + received[6] if received[1:2] == b"\x10" and len(received) > 6 else 8
    return (received[:length], b"!", received[length:]) if len(received) >= length else (b"", b"", received)


def loop_back(mark: int) -> bytes:
    return with_crc(struct.pack(">BBHH", 1, 8, 0, mark))


LOOP_BACK = loop_back(1)
STATUS = read(0x007E, 4)
COMMAND_POSITION = read(0x00C6, 2)
COMMUNICATION_ERROR = read(0x00AC, 2)
STOP_OFF = with_crc(bytes.fromhex("01 06 00 7D 00 00"))
READY_AT_REST = answer(READY | IN_POSITION, 0)
MOVING = answer(MOVE_BIT, 0)
ANSWERS = {
    STATUS: READY_AT_REST,
    POSITION: AT_8500,
    COMMAND_POSITION: answer(0),
    COMMUNICATION_ERROR: answer(0),
    MOVE: MOVE_TAKEN,
    STOP: STOP,
    STOP_OFF: STOP_OFF,
}


def axis_on(port, clock, name, unit, **more):
    az = OrientalAz(
        ModbusUnit(port, unit, device=name),
        clock,
        name=name,
        steps_per_deg=50,
        velocity_deg_s=40,
        acceleration_deg_s2=20_000,
        **more,
    )
    return Axis(az, clock, Travel((-180, 180), settle_s=0.05, tolerance_deg=0.03))


@pytest.fixture
def stage(make_peer, clock):
    stages = []

    def make(changes=None, reply_timeout_s=2.0, **more):
        peer = make_peer(ANSWERS | (changes or {}), split=split)
        port = ModbusPort(peer.port, device="sample_azimuth", reply_timeout_s=reply_timeout_s)
        stages.append(axis_on(port, clock, "sample_azimuth", 1, **more))
        return peer, stages[-1]

    yield make
    for stage in stages:
        stage.close()


def test_checksum_of_this_file_agrees_with_the_published_frames():
    for frame in (MOVE, MOVE_TAKEN, POSITION, AT_8500, STOP, MINUS_1000, MINUS_1000_TAKEN):
        assert with_crc(frame[:-2]) == frame


def test_move_is_the_published_frame(stage):
    peer, stage = stage({STATUS: [READY_AT_REST, MOVING, MOVING, READY_AT_REST]})
    stage.start_move(170)
    assert peer.commands == [POSITION, STATUS, MOVE, STATUS]
    assert [stage.is_moving(), stage.is_moving()] == [True, False]


def test_position_is_the_published_frame(stage):
    peer, stage = stage()
    assert stage.position_deg() == 170.0
    assert peer.commands == [POSITION]


def test_stop_is_the_published_frame_and_is_released(stage):
    peer, stage = stage()
    stage.stop()
    stage.stop()
    assert peer.commands == [STOP, STOP_OFF, STOP, STOP_OFF]


def test_stop_opens_a_lost_link_once_more(stage):
    peer, stage = stage()
    stage.connect()
    peer.vanish()
    stage.stop()
    assert peer.commands[-2:] == [STOP, STOP_OFF]
    assert peer.connections == 2


def test_stop_that_cannot_be_sent_tells_to_cut_the_power(stage):
    peer, stage = stage()
    stage.connect()
    peer.close()
    with pytest.raises(
        NotConnectedError,
        match=r"sample_azimuth: .* may still be moving\. What to do: cut its power or press the emergency stop now",
    ):
        stage.stop()


def test_socket_that_dies_while_it_is_opened_is_not_connected(stage, monkeypatch):
    _, stage = stage()

    def refuse(*_):
        raise OSError("bad descriptor")

    monkeypatch.setattr(socket.socket, "setsockopt", refuse)
    with pytest.raises(NotConnectedError, match="may still be moving"):
        stage.stop()


@pytest.mark.parametrize("echo", ["01 10 00 58 00 0F", "01 10 00 5A 00 10"])
def test_move_that_is_not_echoed_is_refused(stage, echo):
    _, stage = stage({MOVE: with_crc(bytes.fromhex(echo))})
    with pytest.raises(ReplyError, match=r"'write to 0x0058' is .* not 5 bytes that begin with 10 00 58 00 10"):
        stage.start_move(170)


def test_connects_without_moving(stage):
    peer, stage = stage()
    stage.connect()
    assert peer.commands == [STATUS]
    assert (stage.name, stage.settle_s, stage.tolerance_deg) == ("sample_azimuth", 0.05, 0.03)


@pytest.mark.parametrize("target_deg", [180.01, -180.01, float("nan")])
def test_target_outside_the_limits_is_refused_before_the_first_byte(stage, target_deg):
    peer, stage = stage()
    with pytest.raises(LimitError, match=r"sample_azimuth: the target .* outside the limits -180 to 180"):
        stage.start_move(target_deg)
    stage.connect()
    assert peer.commands == [STATUS]


@pytest.mark.parametrize(("code", "text"), [(0x30, "overload"), (0x4A, "home is not set"), (0x99, "see its manual")])
def test_alarm_is_a_fault_with_its_text(stage, code, text):
    _, stage = stage({STATUS: answer(1 << 7, code)})
    for use in (stage.connect, stage.is_moving, lambda: stage.start_move(10)):
        with pytest.raises(DeviceFaultError, match=f"sample_azimuth: the drive has alarm 0x{code:02X}, {text}"):
            use()


def test_drive_that_is_not_ready_is_not_sent_a_move(stage):
    peer, stage = stage({STATUS: MOVING})
    with pytest.raises(DeviceFaultError, match="sample_azimuth: the drive is not ready"):
        stage.start_move(170)
    assert MOVE not in peer.commands


@pytest.mark.usefixtures("no_real_grace")
def test_move_that_the_drive_ignores_is_reported(stage):
    _, stage = stage({COMMUNICATION_ERROR: answer(0x8D)})
    with pytest.raises(DeviceFaultError, match=r"did not begin the move .*0x8D, command not executable"):
        stage.start_move(170)


def test_move_that_begins_late_is_accepted(stage):
    peer, stage = stage({STATUS: [READY_AT_REST, READY_AT_REST, READY_AT_REST, MOVING]})
    stage.start_move(170)
    assert stage.is_moving()
    assert peer.commands.count(MOVE) == 1


def test_move_to_where_the_drive_stands_is_accepted_whatever_was_wrong_before(stage):
    _, stage = stage({COMMAND_POSITION: answer(8500), COMMUNICATION_ERROR: answer(0x84)})
    stage.start_move(170)
    assert not stage.is_moving()


@pytest.mark.parametrize("output", [0, READY, MOVE_BIT, MOVE_BIT | IN_POSITION])
def test_motion_ends_only_at_rest_and_in_position(stage, output):
    _, stage = stage({STATUS: answer(output, 0)})
    assert stage.is_moving()


def test_home_is_the_return_to_the_encoders_zero(stage):
    zhome, zhome_off = with_crc(bytes.fromhex("01 06 00 7D 00 10")), STOP_OFF
    peer, stage = stage({zhome: zhome, STATUS: [READY_AT_REST, MOVING, READY_AT_REST]})
    stage.start_homing()
    assert peer.commands == [STATUS, zhome, zhome_off]
    assert [stage.is_moving(), stage.is_moving()] == [True, False]


RESET = [with_crc(bytes.fromhex(f"01 10 01 80 00 02 04 00 00 00 0{level}")) for level in (0, 1)]
ZHOME = with_crc(bytes.fromhex("01 06 00 7D 00 10"))
HOME_LOST = answer(1 << 7, 0x4A)
CURES = dict.fromkeys(RESET, with_crc(bytes.fromhex("01 10 01 80 00 02"))) | {ZHOME: ZHOME}


def test_homing_that_a_person_asks_for_resets_the_alarm_that_home_is_lost(stage):
    homed = answer(READY | IN_POSITION | 1 << 4, 0)
    peer, stage = stage(
        CURES | {STATUS: [HOME_LOST, HOME_LOST, READY_AT_REST, READY_AT_REST, MOVING, homed]}, may_reset_home_alarm=True
    )
    assert stage.connect() == ("alarm 0x4A, home is not set, which homing resets",)
    assert not stage.is_homed()
    with pytest.raises(DeviceFaultError, match="does not know where its zero is"):
        stage.start_move(10)
    assert peer.commands == [STATUS]
    stage.start_homing()
    assert [command for command in peer.commands if command != STATUS] == [*RESET, ZHOME, STOP_OFF]
    assert [stage.is_moving(), stage.is_moving()] == [True, False]
    assert stage.is_homed()


@pytest.mark.usefixtures("no_real_grace")
def test_alarm_that_cannot_be_reset_is_a_fault_and_nothing_is_moved(stage):
    peer, stage = stage(CURES | {STATUS: HOME_LOST}, may_reset_home_alarm=True)
    stage.connect()
    with pytest.raises(DeviceFaultError, match=r"0x4A, home is not set.* if it comes back, set the home position"):
        stage.start_homing()
    assert ZHOME not in peer.commands


def test_alarm_during_homing_is_not_reset_once_more(stage):
    peer, stage = stage(
        CURES | {STATUS: [HOME_LOST, READY_AT_REST, READY_AT_REST, HOME_LOST]}, may_reset_home_alarm=True
    )
    stage.connect()
    stage.start_homing()
    with pytest.raises(DeviceFaultError, match="0x4A, home is not set"):
        stage.is_moving()
    assert not stage.is_homed()
    assert peer.commands.count(RESET[1]) == 1


def test_homing_of_a_scan_resets_nothing(stage):
    peer, stage = stage(CURES | {STATUS: [READY_AT_REST, HOME_LOST]})
    stage.connect()
    with pytest.raises(DeviceFaultError, match="0x4A, home is not set"):
        stage.start_homing()
    assert not set(RESET) & set(peer.commands)


def test_silent_drive_is_asked_once_and_a_move_is_never_repeated(stage):
    peer, stage = stage({MOVE: b""}, reply_timeout_s=0.05)
    with pytest.raises(ReplyTimeoutError, match="sample_azimuth: no valid answer to the write to 0x0058 of unit 1"):
        stage.start_move(170)
    stage.stop()
    assert peer.commands == [POSITION, STATUS, MOVE, STOP, STOP_OFF]


def test_position_whose_answer_was_lost_is_asked_for_again_and_the_late_one_dropped(stage):
    peer, stage = stage({POSITION: [b"", answer(50)], LOOP_BACK: AT_8500 + LOOP_BACK}, reply_timeout_s=0.05)
    assert stage.position_deg() == 1.0
    assert peer.commands == [POSITION, LOOP_BACK, POSITION]


@pytest.mark.parametrize("garbage", [b"\x00", b"\xff" * 20, AT_8500[:-1] + b"\x00", b"\x02" + AT_8500[1:]])
def test_garbage_is_no_valid_answer(stage, garbage):
    _, stage = stage({POSITION: garbage, STATUS: garbage}, reply_timeout_s=0.02)
    with pytest.raises(ReplyTimeoutError, match="sample_azimuth: no valid answer to the loop-back of unit 1"):
        stage.position_deg()


def test_answer_of_another_length_or_function_is_refused(stage):
    echoes = {loop_back(mark): loop_back(mark) for mark in (1, 2)}
    for wrong in (answer(1, 2), STOP):
        _, wrongly_answering = stage({POSITION: wrong} | echoes)
        with pytest.raises(ReplyError, match=r"'read of 0x00CC' is .* not 6 bytes that begin with 03 04"):
            wrongly_answering.position_deg()


def test_drives_on_one_port_share_it(make_peer, clock):
    second_at_1_deg = {with_crc(b"\x02" + POSITION[1:-2]): with_crc(b"\x02" + answer(50)[1:-2])}
    peer = make_peer(ANSWERS | second_at_1_deg, split=split)
    port = ModbusPort(peer.port, device="line")
    stages = [axis_on(port, clock, f"stage {unit}", unit) for unit in (1, 2)]
    assert [stage.position_deg() for stage in stages] == [170.0, 1.0]
    assert peer.connections == 1
    port.close()


def test_modbus_exception_is_a_fault_with_its_text(stage):
    _, stage = stage({POSITION: with_crc(bytes.fromhex("01 83 02"))})
    with pytest.raises(DeviceFaultError, match="refused the read of 0x00CC with exception 2, illegal address"):
        stage.position_deg()


def test_vanished_drive_is_not_connected(stage):
    peer, stage = stage()
    stage.connect()
    peer.vanish()
    with pytest.raises(NotConnectedError, match=r"sample_azimuth: the link on port .* is gone"):
        stage.position_deg()
