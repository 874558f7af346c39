"""The APT driver against a table of answers in bytes; the frames of single bytes are the fact sheet's."""

from __future__ import annotations

import contextlib
import random
import struct

import pytest
from numpy.testing import assert_allclose

from drivers.thorlabs_apt.messages import (
    GET_CHANNEL_ENABLED,
    GET_DC_STATUS,
    GET_STATUS,
    GET_VELOCITY,
    MOVE_HOME,
    MOVE_STOP,
    REQ_INFO,
    REQ_STATUS,
    SET_CHANNEL_ENABLED,
    Garbled,
    Message,
    Velocity,
    fault_of,
    model_of,
    move_absolute,
    set_velocity,
    short_message,
    status_of,
    take_message,
    velocity_of,
)
from drivers.thorlabs_apt.port import AptPort
from drivers.thorlabs_apt.stage import ThorlabsApt
from drivers.thorlabs_apt.stage_models import APT_STAGES
from goniometer.errors import DeviceFaultError, LimitError, NotConnectedError, ReplyError, ReplyTimeoutError

ENABLED, HOMED, HOMING, MOVING, AT_HOME_SWITCH = 1 << 31, 0x400, 0x200, 0x10, 0x2
READY = ENABLED | HOMED
ASK_INFO = bytes.fromhex("05 00 00 00 50 01")
HOME = bytes.fromhex("43 04 01 00 50 01")
MOVE_45 = bytes.fromhex("53 04 06 00 D0 01 01 00 00 C0 5D 00")
STOP = bytes.fromhex("65 04 01 02 50 01")
ASK_STATUS = bytes.fromhex("80 04 01 00 50 01")
ENABLE = bytes.fromhex("10 02 01 01 50 01")
SET_10_10 = bytes.fromhex("13 04 0E 00 D0 01 01 00 00 00 00 00 AC 3A 00 00 55 55 5E 04")
ASK_ENABLED = bytes.fromhex("11 02 01 00 50 01")
ASK_VELOCITY = bytes.fromhex("14 04 01 00 50 01")
STOP_UPDATES = bytes.fromhex("12 00 00 00 50 01")
NO_BACKLASH = bytes.fromhex("3A 04 06 00 D0 01 01 00 00 00 00 00")
ASK_BACKLASH = bytes.fromhex("3B 04 01 00 50 01")
ASK_HOME = bytes.fromhex("41 04 01 00 50 01")
COUNTS_45 = 6_144_000


def reply(number: int, source: int, data: bytes) -> bytes:
    return struct.pack("<HHBB", number, len(data), 0x81, source) + data


def short_reply(number: int, source: int, first: int, second: int) -> bytes:
    return struct.pack("<HBBBB", number, first, second, 0x01, source)


def info(model: str, source: int = 0x50, serial_number: int = 55_000_001) -> bytes:
    data = struct.pack("<I8sH4B60s3H", serial_number, model.encode(), 16, 1, 0, 3, 0, b"", 1, 0, 1)
    return reply(0x0006, source, data)


def status(counts: int = 0, bits: int = READY, source: int = 0x50) -> bytes:
    return reply(0x0481, source, struct.pack("<HiiI", 1, counts, 0, bits))


def dc_status(counts: int = 0, bits: int = READY) -> bytes:
    return reply(0x0491, 0x50, struct.pack("<HiHHI", 1, counts, 0, 0, bits))


def velocity(acceleration: int = 15_020, speed: int = 73_291_093, source: int = 0x50) -> bytes:
    return reply(0x0415, source, struct.pack("<Hiii", 1, 0, acceleration, speed))


def backlash(counts: int = 0, source: int = 0x50) -> bytes:
    return reply(0x043C, source, struct.pack("<Hi", 1, counts))


def home_settings(offset: int = 0, source: int = 0x50) -> bytes:
    return reply(0x0442, source, struct.pack("<HHHii", 1, 2, 1, 73_291_093, offset))


def completed(counts: int, source: int = 0x50) -> bytes:
    return reply(0x0464, source, struct.pack("<HiiI", 1, counts, 0, READY))


ANSWERS = {
    ASK_INFO: info("K10CR1"),
    ASK_ENABLED: short_reply(0x0212, 0x50, 1, 1),
    ASK_VELOCITY: velocity(),
    ASK_BACKLASH: backlash(),
    ASK_HOME: home_settings(),
    ASK_STATUS: status(),
}


def split(received: bytes) -> tuple[bytes, bytes, bytes]:
    """Split off one message from the host: message, whether there is one, rest."""
    length = 6 + (struct.unpack_from("<H", received, 2)[0] if len(received) > 5 and received[4] & 0x80 else 0)
    return (received[:length], b"!", received[length:]) if len(received) >= length else (b"", b"", received)


FROM_DEVICE = [
    (status(COUNTS_45), Message(GET_STATUS, 0x50, data=struct.pack("<HiiI", 1, COUNTS_45, 0, READY))),
    (dc_status(-7), Message(GET_DC_STATUS, 0x50, data=struct.pack("<HiHHI", 1, -7, 0, 0, READY))),
    (short_reply(0x0212, 0x22, 1, 2), Message(GET_CHANNEL_ENABLED, 0x22, 1, 2)),
    (velocity(source=0x2A), Message(GET_VELOCITY, 0x2A, data=struct.pack("<Hiii", 1, 0, 15_020, 73_291_093))),
    (bytes.fromhex("44 04 01 00 01 50"), Message(0x0444, 0x50, 1, 0)),
    (bytes.fromhex("34 12 00 00 81 11"), Message(0x1234, 0x11)),
]


@pytest.mark.parametrize(("sent", "message"), FROM_DEVICE)
@pytest.mark.parametrize("trailing", [b"", b"\x81", status()[:9], status()])
def test_message_fed_whole(sent, message, trailing):
    received = bytearray(sent + trailing)
    assert take_message(received) == message
    assert received == trailing


@pytest.mark.parametrize(("sent", "message"), FROM_DEVICE)
def test_message_fed_byte_by_byte(sent, message):
    received = bytearray()
    messages = []
    for byte in sent:
        received.append(byte)
        messages.append(take_message(received))
    assert messages == [None] * (len(sent) - 1) + [message]


@pytest.mark.parametrize(
    "garbage",
    ["81 04 0E 00 01", "81 04 0E 00 81 01", "81 04 0E 00 50", "81 04 0E 00 D0 01", "81 04 00 01 81 50", "00" * 6],
)
def test_bytes_that_cannot_become_a_message_to_the_host_are_garbled(garbage):
    received = bytearray.fromhex(garbage)
    if len(received) == 5 and received[4] == 0x01:
        assert take_message(received) is None
        received.append(0x02)
    with pytest.raises(Garbled, match="the bytes"):
        take_message(received)


@pytest.mark.parametrize(
    ("made", "sheet"),
    [
        (short_message(REQ_INFO, 0x50), ASK_INFO),
        (short_message(MOVE_HOME, 0x50, 1), HOME),
        (move_absolute(0x50, COUNTS_45), MOVE_45),
        (short_message(MOVE_STOP, 0x50, 1, 2), STOP),
        (short_message(REQ_STATUS, 0x50, 1), ASK_STATUS),
        (short_message(SET_CHANNEL_ENABLED, 0x50, 1, 1), ENABLE),
        (set_velocity(0x50, APT_STAGES["K10CR1"].words(10, 10)), SET_10_10),
    ],
)
def test_messages_to_the_device_are_those_of_the_sheet(made, sheet):
    assert made == sheet


@pytest.mark.parametrize(
    ("stage", "velocity", "acceleration"),
    [("K10CR1", 7_329_109, 1502.03), ("HDR50", 4_030_885, 826), ("PRM1Z8", 42_941.66, 14.66)],
)
def test_scaling_is_that_of_the_sheet(stage, velocity, acceleration):
    words = APT_STAGES[stage].words(1000, 1000)
    assert_allclose([words.velocity, words.acceleration], [1000 * velocity, 1000 * acceleration], rtol=3e-4)


def test_contents_of_messages():
    assert status_of(FROM_DEVICE[0][1]) == (COUNTS_45, READY)
    assert status_of(FROM_DEVICE[1][1]) == (-7, READY)
    assert velocity_of(FROM_DEVICE[3][1]) == Velocity(15_020, 73_291_093)
    assert model_of(take_message(bytearray(info("BSC201")))) == "BSC201"
    rich = reply(0x0081, 0x11, struct.pack("<HH64s", 0, 12, b"motor stalled\0rubbish"))
    assert fault_of(take_message(bytearray(rich))) == "fault 12: motor stalled"
    assert fault_of(FROM_DEVICE[0][1]) is None
    with pytest.raises(Garbled, match="has 4 bytes of data, not 14"):
        status_of(Message(GET_STATUS, 0x50, data=b"1234"))
    with pytest.raises(Garbled, match="channel 2"):
        status_of(Message(GET_STATUS, 0x50, data=struct.pack("<HiiI", 2, 0, 0, 0)))


def test_parser_survives_mutated_messages():
    rng = random.Random(7)
    frames = [sent for sent, _ in FROM_DEVICE] + [info("K10CR1")]
    longest = 0
    received = bytearray()
    for _ in range(30_000):
        frame = bytearray(rng.choice(frames))
        for _ in range(rng.randrange(4)):
            match rng.randrange(3):
                case 0:
                    frame[rng.randrange(len(frame))] = rng.randrange(256)
                case 1:
                    frame.insert(rng.randrange(len(frame)), rng.randrange(256))
                case 2:
                    del frame[rng.randrange(len(frame))]
        received += frame
        while True:
            try:
                message = take_message(received)
            except Garbled:
                del received[0]
                continue
            if message is None:
                break
            for read in (model_of, status_of, velocity_of, fault_of):
                with contextlib.suppress(Garbled):
                    read(message)
        longest = max(longest, len(received))
    assert 6 < longest < 6 + 255


@pytest.fixture
def port(make_peer, open_link, clock):
    """A port with a table of answers behind it."""

    def make(changes=None, answers=ANSWERS, reply_timeout_s=2.0):
        peer = make_peer(answers | (changes or {}), split=split)
        return peer, AptPort(open_link(peer.port, "rotation stages", reply_timeout_s), clock)

    return make


@pytest.fixture
def stage(port):
    def make(changes=None, home_offset_deg=None, **kwargs):
        peer, apt = port(changes, **kwargs)
        speed = {"velocity_deg_s": 10, "acceleration_deg_s2": 10}
        return peer, ThorlabsApt(apt, "K10CR1", name="source", home_offset_deg=home_offset_deg, **speed)

    return make


def test_connects_without_moving(stage, clock):
    peer, stage = stage()
    assert stage.connect() == ()
    assert peer.commands == [
        ASK_VELOCITY,  # proves that answers belong to questions; of the first question, another kind
        ASK_INFO,
        STOP_UPDATES,
        ENABLE,
        ASK_ENABLED,
        SET_10_10,
        ASK_VELOCITY,
        NO_BACKLASH,
        ASK_BACKLASH,
        ASK_HOME,
        ASK_STATUS,
    ]
    assert clock.time_s == pytest.approx(0.1)


def test_port_is_opened_by_the_ritual_of_the_sheet(stage, clock, monkeypatch, until):
    peer, stage = stage()
    link = stage._channel._port._link
    line = []
    monkeypatch.setattr(link, "set_rts", lambda *, on: line.append((clock.time_s, on)))
    peer.say(status(COUNTS_45))
    until(link.has_input)
    assert stage.position_deg() == 0.0
    assert line == [(0.0, True), (pytest.approx(0.1), False)]


def test_opening_pauses_and_proof_come_again_after_reconnecting(stage, clock):
    peer, stage = stage()
    stage.position_deg()
    stage.position_deg()
    assert clock.time_s == pytest.approx(0.1)
    stage.reconnect()
    stage.position_deg()
    assert clock.time_s == pytest.approx(0.2)
    assert peer.connections == 2
    assert peer.commands == [ASK_VELOCITY, ASK_STATUS, ASK_STATUS, ASK_ENABLED, ASK_STATUS]


def test_another_controller_on_the_port_is_not_taken_for_the_one_before(stage):
    _, stage = stage({ASK_INFO: [info("K10CR1"), info("K10CR1", serial_number=55_000_002)]})
    stage.connect()
    stage.reconnect()
    with pytest.raises(DeviceFaultError, match="another device answers since the link was lost: 'K10CR1 55000002'"):
        stage.connect()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({ASK_INFO: info("KDC101")}, "source: the controller is a 'KDC101', not a K10CR1"),
        ({ASK_ENABLED: short_reply(0x0212, 0x50, 1, 2)}, "source: the channel stays off"),
        ({ASK_VELOCITY: velocity(15_020, 36_645_547)}, r"moves at 5 degrees/s and 10 degrees/s², not at 10 and 10"),
        ({ASK_VELOCITY: velocity(30_040)}, r"moves at 10 degrees/s and 20 degrees/s²"),
        ({ASK_BACKLASH: backlash(136_533)}, "keeps a backlash correction of 0.999998 degrees, by which it would go"),
    ],
)
def test_stage_that_cannot_be_set_up_is_refused(stage, changes, message):
    _, stage = stage(changes)
    with pytest.raises(DeviceFaultError, match=message):
        stage.connect()


def test_faults_left_from_before_are_returned(stage):
    rich = reply(0x0081, 0x50, struct.pack("<HH64s", 0, 12, b"supply was weak"))
    _, stage = stage({ASK_STATUS: rich + status(0, READY | 0x4000 | 0x4000000)})
    notes = stage.connect()
    assert notes == ("a position error: the motor did not follow", "over-current", "fault 12: supply was weak")


def test_home_offset_is_noted_once_and_must_stay(stage):
    _, stage = stage({ASK_HOME: [home_settings(COUNTS_45), home_settings(COUNTS_45), home_settings(0)]})
    (note,) = stage.connect()
    assert note.startswith("source has a home offset of 45 degrees")
    assert stage.connect() == ()
    with pytest.raises(DeviceFaultError, match="source: its home offset is 0 degrees, and should be 45"):
        stage.connect()


def test_home_offset_of_the_rig_file_is_demanded(stage):
    _, as_it_should_be = stage({ASK_HOME: home_settings(COUNTS_45)}, home_offset_deg=45.0)
    assert as_it_should_be.connect() == ()
    peer, stage = stage({ASK_HOME: home_settings(COUNTS_45)}, home_offset_deg=0.0)
    with pytest.raises(DeviceFaultError, match=r"its home offset is 45 degrees, and should be 0: .*home_offset_deg"):
        stage.connect()
    assert not [command for command in peer.commands if command[:2] in (b"\x40\x04", b"\x43\x04")]


@pytest.mark.usefixtures("no_real_grace")
def test_standing_still_a_tenth_of_a_degree_away_is_not_arrived(stage, clock):
    """Until a second has passed, in which it may yet go on; then it stands where it stands, which the scan judges."""
    short_of_it = status(COUNTS_45 - 13_653)
    _, stage = stage({ASK_STATUS: [status(), status(10, READY | MOVING), short_of_it]})
    stage.start_move(45)
    assert [stage.is_moving(), stage.is_moving()] == [True, True]
    clock.time_s += 2
    assert not stage.is_moving()
    assert stage.position_deg() == pytest.approx(44.9, abs=1e-3)


def test_move_is_the_sheets_and_ends_with_the_status(stage):
    moving, there = status(100_000, READY | MOVING), status(COUNTS_45)
    peer, stage = stage({ASK_STATUS: [status(), status(), moving, moving, there]})
    assert stage.is_homed()
    stage.start_move(45)
    assert [stage.is_moving(), stage.is_moving(), stage.is_moving(), stage.is_moving()] == [True, True, False, False]
    assert stage.position_deg() == 45.0
    assert peer.commands.count(MOVE_45) == 1


def test_completions_between_the_answers_change_nothing(stage):
    late = completed(0) + completed(COUNTS_45, source=0x22) + short_reply(0x0464, 0x50, 1, 0)
    moving = late + status(100_000, READY | MOVING) + completed(COUNTS_45)
    _, stage = stage({ASK_STATUS: [status(), moving, late + status(COUNTS_45)]})
    stage.start_move(45)
    assert [stage.is_moving(), stage.is_moving()] == [True, False]
    assert stage.position_deg() == 45.0


@pytest.mark.parametrize("bit", [0x10, 0x20, 0x40, 0x80])
def test_either_sense_of_moving_is_moving(stage, bit):
    _, stage = stage({ASK_STATUS: [status(), status(COUNTS_45, READY | bit)]})
    stage.start_move(45)
    assert stage.is_moving()


def test_negative_angles(stage):
    move = bytes.fromhex("53 04 06 00 D0 01 01 00") + struct.pack("<i", -COUNTS_45)
    peer, stage = stage({ASK_STATUS: status(-COUNTS_45)})
    stage.start_move(-45)
    assert not stage.is_moving()
    assert stage.position_deg() == -45.0
    assert peer.commands[-3:] == [move, ASK_STATUS, ASK_STATUS]


def test_target_that_has_no_message_is_refused_before_the_first_byte(stage):
    peer, stage = stage()
    with pytest.raises(LimitError, match="source: the target 15800 degrees is more than the 15729 degrees"):
        stage.start_move(15_800)
    assert peer.commands == []


@pytest.mark.usefixtures("no_real_grace")
def test_move_that_is_ignored_is_reported_after_a_second(stage, clock):
    peer, stage = stage()
    stage.start_move(45)
    begun_s = clock.time_s
    clock.time_s = begun_s + 1 - 1e-6
    assert stage.is_moving()
    clock.time_s = begun_s + 1 + 1e-6
    with pytest.raises(
        DeviceFaultError, match=r"source: the stage stands still at 0 degrees, .*the move to 45 degrees"
    ):
        stage.is_moving()
    assert peer.commands.count(MOVE_45) == 1


@pytest.mark.usefixtures("no_real_grace")
def test_stage_that_stops_at_a_limit_is_a_fault(stage, clock):
    at_limit = status(COUNTS_45 // 3, READY | 0x1)
    _, stage = stage({ASK_STATUS: [status(), status(100, READY | MOVING), at_limit]})
    stage.start_move(45)
    assert stage.is_moving()
    assert stage.is_moving()
    clock.time_s += 1.1
    with pytest.raises(DeviceFaultError, match="stands still at 15 degrees, at the clockwise limit switch"):
        stage.is_moving()


@pytest.mark.usefixtures("no_real_grace")
def test_stage_that_stopped_elsewhere_for_no_reason_has_stopped(stage, clock):
    """Whether it stands where it should is the axis' to judge; a stop at the panel is no fault."""
    _, stage = stage({ASK_STATUS: [status(), status(100, READY | MOVING), status(COUNTS_45 // 3)]})
    stage.start_move(45)
    assert stage.is_moving()
    clock.time_s += 1.1
    assert not stage.is_moving()


def test_stage_that_stands_at_a_limit_switch_may_leave_it(stage):
    _, stage = stage({ASK_STATUS: [status(0, READY | AT_HOME_SWITCH), status(9, READY | AT_HOME_SWITCH | MOVING)]})
    stage.start_move(45)
    assert stage.is_moving()


@pytest.mark.parametrize(
    ("bits", "message"),
    [
        (READY | 0x4000, "a position error"),
        (READY | 0x4000 | 0x4000000, "a position error: the motor did not follow and over-current"),
        (READY | 0x1000000, "an overload of the motor"),
        (READY | 0x40000000, "the controller reports an error"),
        (HOMED, "the channel is off and the motor without power"),
        (ENABLED, "has lost its home position: it was switched off or reset"),
        (0, "has lost its home position"),
    ],
)
def test_what_goes_wrong_in_motion_is_a_fault(stage, bits, message):
    _, stage = stage({ASK_STATUS: [status(), status(1, READY | MOVING), status(2, bits | MOVING)]})
    stage.start_move(45)
    assert stage.is_moving()
    with pytest.raises(DeviceFaultError, match=f"source: .*{message}.* Not done: the move to 45 degrees"):
        stage.is_moving()


def test_fault_that_the_controller_tells_of_its_own_accord_is_raised(stage):
    rich = reply(0x0081, 0x50, struct.pack("<HH64s", 0, 12, b"motor stalled"))
    _, stage = stage({ASK_STATUS: [status(), rich + status(1, READY | MOVING)]})
    stage.start_move(45)
    with pytest.raises(DeviceFaultError, match="source: the controller reports fault 12: motor stalled"):
        stage.is_moving()


@pytest.mark.parametrize("bits", [HOMED, READY | 0x8000])
def test_controller_with_a_fault_is_not_sent_a_motion(stage, bits):
    peer, stage = stage({ASK_STATUS: status(0, bits)})
    for start in (lambda: stage.start_move(45), stage.start_homing):
        with pytest.raises(DeviceFaultError, match="source: "):
            start()
    assert MOVE_45 not in peer.commands
    assert HOME not in peer.commands


def test_homing_ends_when_the_stage_has_moved_and_is_homed(stage):
    homing = status(777, ENABLED | HOMING)
    _, stage = stage({ASK_STATUS: [status(777, READY), homing, homing, short_reply(0x0444, 0x50, 1, 0) + status()]})
    stage.start_homing()
    assert [stage.is_moving(), stage.is_moving(), stage.is_moving()] == [True, True, False]
    assert stage.is_homed()


@pytest.mark.usefixtures("no_real_grace")
def test_homing_that_is_ignored_is_not_taken_for_done_for_an_earlier_one(stage, clock):
    _, stage = stage({ASK_STATUS: status(COUNTS_45, READY)})
    stage.start_homing()
    assert stage.is_moving()
    clock.time_s += 1.1
    with pytest.raises(DeviceFaultError, match=r"stands still at 45 degrees, .*Not done: the homing"):
        stage.is_moving()


@pytest.mark.usefixtures("no_real_grace")
def test_homing_of_a_stage_at_home_that_no_poll_saw_move_is_done_after_a_second(stage, clock):
    _, stage = stage()
    stage.start_homing()
    assert stage.is_moving()
    clock.time_s += 1.1
    assert not stage.is_moving()


@pytest.mark.usefixtures("no_real_grace")
def test_homing_that_finds_nothing_is_a_fault(stage, clock):
    _, stage = stage({ASK_STATUS: [status(5, ENABLED), status(9, ENABLED | HOMING), status(7, ENABLED | 0x2)]})
    stage.start_homing()
    assert stage.is_moving()
    clock.time_s += 1.1
    with pytest.raises(DeviceFaultError, match=r"at the counter-clockwise limit switch\. Not done: the homing"):
        stage.is_moving()


def test_stop_is_the_sheets_and_is_known_to_have_got_through(stage):
    peer, stage = stage({ASK_STATUS: [status(), status(9, READY | MOVING), status(9, READY | MOVING), status(50)]})
    stage.start_move(45)
    assert stage.is_moving()
    stage.stop()
    assert peer.commands[-2:] == [STOP, ASK_STATUS]
    assert not stage.is_moving()


def test_stop_that_nobody_answers_is_an_error(stage):
    peer, stage = stage({ASK_STATUS: b""}, reply_timeout_s=0.05)
    with pytest.raises(ReplyTimeoutError, match="source: "):
        stage.stop()
    assert peer.commands.count(STOP) == 1


def test_lost_link_is_told_and_can_be_opened_afresh(stage, until):
    peer, stage = stage()
    stage.connect()
    peer.vanish()

    def is_gone():
        try:
            stage.position_deg()
        except NotConnectedError:
            return True
        return False

    until(is_gone)
    stage.reconnect()
    assert stage.position_deg() == 0.0


def test_late_answer_is_not_taken_for_the_next_one(stage):
    """The position of the lost answer comes, at the earliest, with the answer to the question that proves."""
    late = status(COUNTS_45) + ANSWERS[ASK_ENABLED]
    _, stage = stage({ASK_STATUS: [status(), b"", status(100)], ASK_ENABLED: late}, reply_timeout_s=0.2)
    assert stage.position_deg() == 0.0
    assert stage.position_deg() == pytest.approx(100 / 136_533.33)


def test_answer_to_one_proof_is_not_taken_for_that_to_the_next(stage):
    """Three attempts prove with two kinds of question in turn; the third finds the late answer to the first."""
    changes = {
        ASK_VELOCITY: [velocity(), b"", b"", velocity()],
        ASK_ENABLED: [b"", velocity() + status(COUNTS_45) + ANSWERS[ASK_ENABLED]],
        ASK_STATUS: [status(), b"", status(100)],
    }
    peer, stage = stage(changes, reply_timeout_s=0.2)
    assert stage.position_deg() == 0.0
    with pytest.raises(ReplyTimeoutError, match="no complete answer"):
        stage.position_deg()
    assert stage.position_deg() == pytest.approx(100 / 136_533.33)
    assert peer.commands.count(ASK_ENABLED) == 2


@pytest.mark.parametrize(
    "noise",
    [b"\x00", b"\xff" * 7, b"\x01\x81\x50", status()[3:], status()[:-3], b"\x81\x04\x0e\x00\x81\x50", b"x" * 300],
)
def test_noise_before_a_question_does_no_harm(stage, noise, until):
    peer, stage = stage({ASK_STATUS: [status(100), status(200)]})
    assert stage.position_deg() == pytest.approx(100 / 136_533.33)
    peer.say(noise)
    link = stage._channel._port._link
    until(link.has_input)
    assert stage.position_deg() == pytest.approx(200 / 136_533.33)


@pytest.mark.parametrize("garbage", [b"\x00" * 6, b"\xff" * 40, status()[1:], b"\x81" + status()])
def test_garbage_for_an_answer_is_dropped_and_the_question_repeated(stage, garbage):
    peer, stage = stage({ASK_STATUS: [garbage, status(100)]})
    assert stage.position_deg() == pytest.approx(100 / 136_533.33)
    assert peer.commands.count(ASK_STATUS) == 2


def test_answer_that_proves_is_found_behind_garbage(stage):
    peer, stage = stage({ASK_VELOCITY: b"\xff\x81\x04\x00" + velocity(), ASK_STATUS: status(100)})
    assert stage.position_deg() == pytest.approx(100 / 136_533.33)
    assert peer.commands == [ASK_VELOCITY, ASK_STATUS]


def test_garbage_for_every_answer_is_an_error_that_names_the_axis(stage):
    peer, stage = stage({ASK_STATUS: b"\xff" * 20})
    with pytest.raises(ReplyError, match=r"source: the answer to 80 04 01 00 50 01 .* is garbled: the bytes ff ff"):
        stage.position_deg()
    assert peer.commands.count(ASK_STATUS) == 3


@pytest.mark.parametrize(
    "answer", [reply(0x0481, 0x50, b"1234"), reply(0x0481, 0x50, struct.pack("<HiiI", 2, 0, 0, 0))]
)
def test_answer_of_another_length_or_channel_is_refused(stage, answer):
    _, stage = stage({ASK_STATUS: answer})
    with pytest.raises(ReplyError, match=r"source: .* is garbled: "):
        stage.position_deg()


def test_garbage_after_a_move_was_sent_does_not_repeat_the_move(stage):
    moving = status(100, READY | MOVING)
    peer, stage = stage({ASK_STATUS: [status(), b"\xff" * 20, moving, status(COUNTS_45)]})
    stage.start_move(45)
    assert [stage.is_moving(), stage.is_moving()] == [True, False]
    assert peer.commands.count(MOVE_45) == 1


def test_status_that_comes_unasked_is_not_taken_for_the_answer(stage, until):
    peer, stage = stage({ASK_STATUS: [status(100), status(200)]})
    assert stage.position_deg() == pytest.approx(100 / 136_533.33)
    peer.say(status(COUNTS_45) * 20)
    until(stage._channel._port._link.has_input)
    assert stage.position_deg() == pytest.approx(200 / 136_533.33)


def test_dc_controller_is_acknowledged_with_every_question(port):
    ask = bytes.fromhex("90 04 01 00 50 01")
    peer, apt = port({ask: dc_status(19_196), ASK_INFO: info("KDC101"), ASK_VELOCITY: velocity(366, 1_073_542)})
    stage = ThorlabsApt(apt, "PRM1Z8", name="analyzer", velocity_deg_s=25, acceleration_deg_s2=25)
    assert stage.connect() == ()
    assert stage.position_deg() == pytest.approx(10.0, abs=1e-3)
    assert peer.commands[-2:] == [bytes.fromhex("92 04 00 00 50 01"), ask]


def rack(model: str = "BSC203", used: int = 1) -> dict[bytes, bytes]:
    answers = {bytes.fromhex("05 00 00 00 11 01"): info(model, 0x11)}
    for bay in range(3):
        address = 0x21 + bay
        answers |= {
            bytes((0x60, 0, bay, 0, 0x11, 1)): short_reply(0x0061, 0x11, bay, used),
            bytes((0x11, 2, 1, 0, address, 1)): short_reply(0x0212, address, 1, 1),
            bytes((0x14, 4, 1, 0, address, 1)): velocity(66_086, 201_544_247, address),
            bytes((0x3B, 4, 1, 0, address, 1)): backlash(0, address),
            bytes((0x41, 4, 1, 0, address, 1)): home_settings(0, address),
            bytes((0x80, 4, 1, 0, address, 1)): status(75_091 * bay, READY, address),
        }
    return answers


def bay_stage(apt: AptPort, bay: int) -> ThorlabsApt:
    return ThorlabsApt(apt, "HDR50", name=f"arm {bay}", velocity_deg_s=50, acceleration_deg_s2=80, bay=bay)


def test_bays_of_a_rack_share_a_port(port):
    peer, apt = port(answers=rack())
    stages = [bay_stage(apt, bay) for bay in (1, 2, 3)]
    for stage in stages:
        assert stage.connect() == ()
    assert_allclose([stage.position_deg() for stage in stages], [0, 1, 2])
    stages[1].start_move(90)
    assert stages[1].is_moving()
    assert peer.commands[-2] == bytes.fromhex("53 04 06 00 A2 01 01 00") + struct.pack("<i", 6_758_190)
    assert peer.connections == 1


def test_answer_and_fault_of_one_bay_are_not_anothers(port):
    rich = reply(0x0081, 0x22, struct.pack("<HH64s", 0, 12, b"motor stalled"))
    ask = bytes((0x80, 4, 1, 0, 0x21, 1))
    others = status(99, READY, 0x22) + completed(99, 0x22) + rich
    _, apt = port({ask: [status(5, READY, 0x21), others + status(75_091, READY, 0x21)]}, answers=rack())
    first, second = bay_stage(apt, 1), bay_stage(apt, 2)
    first.start_move(1)
    assert not first.is_moving()
    assert first.position_deg() == 1.0
    with pytest.raises(DeviceFaultError, match="arm 2: the controller reports fault 12: motor stalled"):
        second.start_move(3)


@pytest.mark.parametrize(
    ("answers", "message"),
    [(rack(used=2), "bay 1 of the BSC203 is empty"), (rack("BBD103"), "is a 'BBD103', not a BSC201")],
)
def test_rack_without_the_stage_is_refused(port, answers, message):
    _, apt = port(answers=answers)
    with pytest.raises(DeviceFaultError, match=f"arm 1: .*{message}"):
        bay_stage(apt, 1).connect()
