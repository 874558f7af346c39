"""The simulated APT controllers speak the protocol of their fact sheet."""

import random
import struct
from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from sim_devices.axis import Axis
from sim_devices.thorlabs_apt.controller import ThorlabsApt
from sim_devices.thorlabs_apt.messages import AptMessage, AptReader
from sim_devices.thorlabs_apt.models import BSC200_HDR50, K10CR1, KBD101_DDR25, KBD101_DDR100, KDC101_PRM1Z8

MOVING, HOMING, HOMED, SETTLED, ENABLED = 0x30, 0x200, 0x400, 0x2000, 0x8000_0000
REQ_STATUS, REQ_SERVO_STATUS = b"\x80\x04\x01\x00\x50\x01", b"\x90\x04\x01\x00\x50\x01"
HOME = b"\x43\x04\x01\x00\x50\x01"
TO_45_DEG = bytes.fromhex("53 04 06 00 D0 01 01 00 00 C0 5D 00")
STOP = b"\x65\x04\x01\x02\x50\x01"
START_UPDATES, STOP_UPDATES = b"\x11\x00\x00\x00\x50\x01", b"\x12\x00\x00\x00\x50\x01"


def short(number, first=1, second=0, destination=0x50, source=1):
    return struct.pack("<HBBBB", number, first, second, destination, source)


def long(number, data, destination=0x50, source=1):
    return struct.pack("<HHBB", number, len(data), destination | 0x80, source) + data


def move_absolute(counts, **addresses):
    return long(0x0453, struct.pack("<Hi", 1, counts), **addresses)


@pytest.fixture
def axis():
    return Axis(K10CR1.step_deg)


@pytest.fixture
def k10cr1(axis):
    return ThorlabsApt(K10CR1, {1: axis})


@pytest.fixture
def talk(converse, k10cr1):
    return converse(k10cr1)


@pytest.fixture
def kdc101():
    return ThorlabsApt(KDC101_PRM1Z8, {1: Axis(KDC101_PRM1Z8.step_deg)})


@pytest.fixture
def rack():
    return ThorlabsApt(BSC200_HDR50, {number: Axis(BSC200_HDR50.step_deg) for number in (1, 3)})


def numbers(heard):
    return [int.from_bytes(message[:2], "little") for _, message in heard]


def status(talk, now_s):
    """Position, encoder and bits as a stepper tells them."""
    talk.hear(now_s)
    talk.send(REQ_STATUS, now_s)
    ((_, message),) = talk.hear(now_s + 0.005)
    assert message[:6] == b"\x81\x04\x0e\x00\x81\x50"
    return struct.unpack("<HiiI", message[6:])[1:]


ANSWERS = [
    ("05 00 00 00 50 01", "06 00 54 00 81 50", 90),
    ("80 04 01 00 50 01", "81 04 0E 00 81 50 01 00 00 00 00 00 00 00 00 00 00 21 00 90", 20),
    ("29 04 01 00 50 01", "2A 04 06 00 81 50 01 00 00 21 00 90", 12),
    ("11 02 01 00 50 01", "12 02 01 01 01 50", 6),
    ("10 02 01 02 50 01 11 02 01 00 50 01", "12 02 01 02 01 50", 6),
    ("10 02 01 02 50 01 10 02 01 01 50 01 11 02 01 00 50 01", "12 02 01 01 01 50", 6),
    # 10 deg/s, 10 deg/s², as it was set and as it is after power-on
    (
        "13 04 0E 00 D0 01 01 00 00 00 00 00 AC 3A 00 00 55 55 5E 04 14 04 01 00 50 01",
        "15 04 0E 00 81 50 01 00 00 00 00 00 AC 3A 00 00 55 55 5E 04",
        20,
    ),
    ("14 04 01 00 50 01", "15 04 0E 00 81 50 01 00 00 00 00 00 AC 3A 00 00 55 55 5E 04", 20),
    ("10 04 06 00 D0 01 01 00 FE FF FF FF 11 04 01 00 50 01", "12 04 06 00 81 50 01 00 FE FF FF FF", 12),
    ("09 04 06 00 D0 01 01 00 07 00 00 00 0A 04 01 00 50 01", "0B 04 06 00 81 50 01 00 07 00 00 00", 12),
    ("11 04 01 00 50 01", "12 04 06 00 81 50 01 00 00 00 00 00", 12),
    # to another host
    ("11 02 01 00 50 02", "12 02 01 01 02 50", 6),
    ("11 04 01 00 50 02", "12 04 06 00 82 50 01 00 00 00 00 00", 12),
    # nobody asked, or nobody is there
    ("02 00 00 00 50 01", "", 0),
    ("18 00 00 00 50 01", "", 0),
    ("23 02 00 00 50 01", "", 0),
    ("60 00 00 00 50 01", "", 0),
    ("90 04 01 00 50 01", "", 0),
    ("80 04 02 00 50 01", "", 0),
    ("80 04 01 00 11 01", "", 0),
    ("80 04 01 00 21 01", "", 0),
    # unknown ones, short and long, and one whose data have another length
    ("99 09 01 00 50 01 11 02 01 00 50 01", "12 02 01 01 01 50", 6),
    ("99 09 03 00 D0 01 43 04 01 11 02 01 00 50 01", "12 02 01 01 01 50", 6),
    ("18 40 01 00 50 01 11 02 01 00 50 01", "12 02 01 01 01 50", 6),
    ("18 40 02 00 D0 01 11 00 11 02 01 00 50 01", "12 02 01 01 01 50", 6),
    ("10 04 04 00 D0 01 01 00 07 00 11 04 01 00 50 01", "12 04 06 00 81 50 01 00 00 00 00 00", 12),
    # behind noise
    ("FF 11 02 01 00 50 01", "12 02 01 01 01 50", 6),
    ("00 00 00 00 00 00 00 11 02 01 00 50 01", "12 02 01 01 01 50", 6),
    ("11 02 FF FF D0 01 11 02 01 00 50 01", "12 02 01 01 01 50", 6),
]


@pytest.mark.parametrize(("sent", "begins", "size"), ANSWERS)
def test_messages_are_answered(k10cr1, feed, sent, begins, size):
    replies = feed(k10cr1.session(), bytes.fromhex(sent), trailing=b"\x43\x04\x01")
    answer = b"".join(reply for _, reply in replies)
    assert answer.startswith(bytes.fromhex(begins))
    assert len(answer) == size


PARAMETERS = [
    (0x0413, "<Hiii", (1, 3, 12345, 7654321)),
    (0x0416, "<HHiiiiH", (1, 1, -4711, 1, 2, 3, 2)),
    (0x0423, "<HHHiiH", (1, 3, 2, -5, 5, 1)),
    (0x0426, "<HHH", (1, 10, 90)),
    (0x043A, "<Hi", (1, -1000)),
    (0x0440, "<HHHii", (1, 1, 4, 20000, -300)),
    (0x0445, "<Hi", (1, -2_000_000_000)),
    (0x0450, "<Hi", (1, 2_000_000_000)),
    (0x04B6, "<HHiiHH", (1, 1, 5, -5, 400, 500)),
]


@pytest.mark.parametrize(("number", "form", "values"), PARAMETERS)
def test_what_was_set_is_told_exactly(k10cr1, feed, number, form, values):
    data = struct.pack(form, *values)
    ((_, answer),) = feed(k10cr1.session(), long(number, data) + short(number + 1))
    assert answer == struct.pack("<HHBB", number + 2, len(data), 0x81, 0x50) + data


@pytest.mark.parametrize(
    ("model", "name"), [(K10CR1, b"K10CR1"), (KDC101_PRM1Z8, b"KDC101"), (KBD101_DDR25, b"KBD101")]
)
def test_a_single_unit_says_what_it_is(model, name):
    ((_, message),) = ThorlabsApt(model, {1: Axis(0.01)}).session().receive(short(0x0005), 0.0)
    serial, told = struct.unpack_from("<I8s", message, 6)
    assert serial == model.serial_number
    assert told.rstrip(b"\0") == name
    assert struct.unpack_from("<HHH", message, 84)[2] == 1


def test_scales_are_those_of_the_sheet():
    assert_allclose(K10CR1.counts_per_deg, 136533.3333, rtol=1e-9)
    for model, velocity, acceleration in [
        (K10CR1, 7_329_109, 1502.03),
        (BSC200_HDR50, 4_030_885, 826),
        (KDC101_PRM1Z8, 42_941.66, 14.66),
        (KBD101_DDR100, 9102.22 * 102.4e-6 * 65536, 9102.22 * 102.4e-6**2 * 65536),
        (KBD101_DDR25, 4000 * 102.4e-6 * 65536, 4000 * 102.4e-6**2 * 65536),
    ]:
        assert_allclose(model.velocity_scale, velocity, rtol=2e-6)
        assert_allclose(model.acceleration_scale, acceleration, rtol=5e-4)


def test_a_move_takes_the_time_of_its_trapezoid_and_is_told(talk, axis):
    talk.send(TO_45_DEG, 10.0)
    # 45/10 + 10/10 s, heard 12 bytes after they were sent
    end_s = 10.0 + 12 * 10 / 115200 + 5.5
    assert talk.hear(end_s) == []
    assert not status(talk, end_s - 0.1)[2] & SETTLED
    ((told_s, message),) = talk.hear(end_s + 0.1)
    assert_allclose(told_s, end_s, atol=0.003)
    assert message[:6] == b"\x64\x04\x0e\x00\x81\x50"
    assert struct.unpack("<HiiI", message[6:]) == (1, 6_144_000, 6_144_000, 0x9000_2100)
    assert_allclose(axis.position_deg(20.0), 45.0)


def test_a_reply_takes_its_bytes_time_and_the_next_waits_for_it(k10cr1):
    first, second = k10cr1.session().receive(REQ_STATUS * 2, 1.0)
    byte_s = 10 / 115200
    assert_allclose([first[0], second[0]], [1.002 + 32 * byte_s, 1.002 + 52 * byte_s])


@pytest.mark.parametrize(("counts", "bits"), [(1_000_000, 0x20), (-1_000_000, 0x10)])
def test_status_tells_the_direction_of_a_motion(talk, counts, bits):
    talk.send(move_absolute(counts), 0.0)
    assert status(talk, 0.5)[2] == 0x9000_0100 | bits


def test_an_empty_move_is_not_told_by_a_k10cr1(talk):
    talk.send(move_absolute(5000), 0.0)
    assert numbers(talk.hear(5.0)) == [0x0464]
    talk.send(move_absolute(5000), 5.0)
    assert talk.hear(60.0) == []
    assert status(talk, 60.0)[0] == 5000


def test_an_empty_move_is_told_by_a_unit_that_does(converse, axis):
    model = replace(K10CR1, completes_empty_moves=True, completes_with_status=False)
    talk = converse(ThorlabsApt(model, {1: axis}))
    talk.send(move_absolute(0), 0.0)
    ((told_s, message),) = talk.hear(60.0)
    assert message == b"\x64\x04\x01\x00\x01\x50"
    assert told_s < 0.01


def test_a_new_target_takes_the_old_ones_place_and_one_end_is_told(talk):
    talk.send(TO_45_DEG, 0.0)
    talk.send(move_absolute(-136_533), 2.0)
    ((_, message),) = talk.hear(60.0)
    assert message[:2] == b"\x64\x04"
    assert struct.unpack_from("<i", message, 8)[0] == -136_533


def test_relative_moves_count_from_here(talk):
    talk.send(long(0x0448, struct.pack("<Hi", 1, 1000)), 0.0)
    talk.send(long(0x0448, struct.pack("<Hi", 1, -300)), 5.0)
    talk.send(long(0x0445, struct.pack("<Hi", 1, 50)) + short(0x0448), 10.0)
    assert numbers(talk.hear(20.0)) == [0x0464] * 3
    assert status(talk, 20.0)[0] == 750


def test_a_stored_target_is_gone_to(talk):
    talk.send(long(0x0450, struct.pack("<Hi", 1, 4242)) + short(0x0453), 0.0)
    assert numbers(talk.hear(5.0)) == [0x0464]
    assert status(talk, 5.0)[0] == 4242


@pytest.mark.parametrize(("mode", "way_deg", "rest_s"), [(2, 5.0, 1.0), (1, 0.0, 0.0)])
def test_a_stop_ends_a_motion_which_then_is_not_completed(talk, axis, mode, way_deg, rest_s):
    talk.send(TO_45_DEG, 0.0)
    before_deg = axis.position_deg(2.0)
    talk.send(short(0x0465, 1, mode), 2.0)
    ((told_s, message),) = talk.hear(60.0)
    assert message[:6] == b"\x66\x04\x0e\x00\x81\x50"
    assert_allclose(told_s, 2.0 + rest_s, atol=0.01)
    # 10²/20 deg until it rests
    assert_allclose(axis.position_deg(60.0), before_deg + way_deg, atol=0.02)
    assert struct.unpack_from("<I", message, 16)[0] & (MOVING | SETTLED) == SETTLED


def test_a_stop_at_rest_is_told_at_once(talk):
    talk.send(STOP, 3.0)
    assert numbers(talk.hear(3.01)) == [0x0466]


def test_homing_turns_to_the_switch_then_to_the_offset_and_counts_from_there(talk, axis):
    talk.send(move_absolute(round(100 * K10CR1.counts_per_deg)), 0.0)
    talk.hear(50.0)
    talk.send(HOME, 50.0)
    position, _, bits = status(talk, 55.0)
    assert position > 0
    assert bits & (HOMING | HOMED | MOVING) == HOMING | 0x10
    assert axis.position_deg(61.5) < 0
    ((told_s, message),) = talk.hear(100.0)
    assert message == b"\x44\x04\x01\x00\x01\x50"
    # 104 deg back and 4 deg forth at 10 deg/s and 10 deg/s²
    assert_allclose(told_s, 50.0 + (10.4 + 1) + 2 * (4 / 10) ** 0.5, atol=0.01)
    assert status(talk, 100.0) == (0, 0, 0x9000_2500)
    assert_allclose(axis.position_deg(100.0), 0.0, atol=1e-6)


@pytest.mark.parametrize(("start_deg", "home_s"), [(-3.0, 1.9), (-5.0, 38.2), (355.0, 38.2)])
def test_homing_from_afar_takes_up_to_a_turn(talk, axis, start_deg, home_s):
    talk.send(move_absolute(round(start_deg * K10CR1.counts_per_deg)), 0.0)
    talk.hear(50.0)
    talk.send(HOME, 50.0)
    ((told_s, _),) = talk.hear(100.0)
    assert_allclose(told_s - 50.0, home_s, atol=0.1)
    assert_allclose(axis.position_deg(100.0) % 360, 0.0, atol=1e-5)


def test_homing_follows_its_parameters(talk, axis):
    offset = round(-10 * K10CR1.counts_per_deg)
    talk.send(long(0x0440, struct.pack("<HHHii", 1, 1, 1, round(5 * K10CR1.velocity_scale), offset)), 0.0)
    talk.send(HOME, 0.0)
    # forwards from 0 to the switch at 356 deg, and back by 10 deg, at 5 deg/s
    ((told_s, _),) = talk.hear(200.0)
    assert_allclose(told_s, 356 / 5 + 0.5 + 10 / 5 + 0.5, atol=0.01)
    assert_allclose(axis.position_deg(200.0), 346.0, atol=1e-5)
    assert status(talk, 200.0)[0] == 0


def test_homing_that_is_stopped_is_no_home(talk):
    talk.send(HOME, 0.0)
    talk.hear(10.0)
    assert status(talk, 10.0)[2] & HOMED
    talk.send(move_absolute(6_144_000), 10.0)
    talk.hear(20.0)
    talk.send(HOME, 20.0)
    talk.send(STOP, 22.0)
    assert numbers(talk.hear(100.0)) == [0x0466]
    position, _, bits = status(talk, 100.0)
    assert not bits & (HOMED | HOMING)
    assert 0 < position < 6_144_000


def test_a_disabled_channel_does_not_move(talk, axis):
    talk.send(short(0x0210, 1, 2), 0.0)
    for request in (HOME, TO_45_DEG, long(0x0448, struct.pack("<Hi", 1, 9)), short(0x0457, 1, 1), short(0x046A, 1, 1)):
        talk.send(request, 1.0)
    assert talk.hear(100.0) == []
    assert axis.position_deg(100.0) == 0.0
    assert not status(talk, 100.0)[2] & ENABLED


def test_disabling_ends_a_motion_without_a_word(talk, axis):
    talk.send(TO_45_DEG, 0.0)
    talk.send(short(0x0210, 1, 2), 2.0)
    assert talk.hear(100.0) == []
    assert_allclose(axis.position_deg(100.0), axis.position_deg(2.0), atol=0.02)


def test_a_jog_goes_one_step_at_its_own_speed(talk):
    counts, velocity = K10CR1.counts_per_deg, K10CR1.velocity_scale
    jog = struct.pack("<HHiiiiH", 1, 2, round(2 * counts), 0, 15020, round(velocity), 2)
    talk.send(long(0x0416, jog) + short(0x046A, 1, 2), 0.0)
    assert status(talk, 0.5)[2] & 0xF0 == 0x40
    ((told_s, _),) = talk.hear(60.0)
    assert_allclose(told_s, 2.0 + 0.1, atol=0.01)
    assert status(talk, 60.0)[0] == round(-2 * counts)


@pytest.mark.parametrize("request_bytes", [short(0x0457, 1, 1), short(0x046A, 1, 1)])
def test_a_motion_without_target_runs_until_it_is_stopped(talk, axis, request_bytes):
    jog = struct.pack("<HHiiiiH", 1, 1, 0, 0, 15020, round(10 * K10CR1.velocity_scale), 2)
    talk.send(long(0x0416, jog) + request_bytes, 0.0)
    assert talk.hear(100.0) == []
    assert axis.position_deg(100.0) > 900
    talk.send(STOP, 100.0)
    assert numbers(talk.hear(102.0)) == [0x0466]


def test_a_stepper_counts_what_it_was_told_and_its_encoder_what_has_come_of_it(talk, axis):
    axis.position_deg = lambda time_s: axis.motor_deg(time_s) + 0.01
    talk.send(TO_45_DEG, 0.0)
    ((_, message),) = talk.hear(20.0)
    assert struct.unpack("<Hii", message[6:16]) == (1, 6_144_000, 6_144_000 + 1365)
    talk.send(short(0x0411) + short(0x040A), 20.0)
    assert [struct.unpack("<i", told[8:])[0] for _, told in talk.hear(21.0)] == [6_144_000, 6_145_365]
    # the next one begins where the last one was told to end
    talk.send(long(0x0448, struct.pack("<Hi", 1, 1000)), 21.0)
    talk.hear(25.0)
    assert_allclose(axis.motor_deg(25.0), 45.0 + 1000 / K10CR1.counts_per_deg)


def test_a_servo_counts_what_its_encoder_tells(converse):
    axis = Axis(KDC101_PRM1Z8.step_deg)
    axis.position_deg = lambda time_s: axis.motor_deg(time_s) + 0.01
    talk = converse(ThorlabsApt(KDC101_PRM1Z8, {1: axis}))
    talk.send(REQ_SERVO_STATUS, 0.0)
    ((_, message),) = talk.hear(1.0)
    assert struct.unpack_from("<i", message, 8)[0] == 19


def test_counters_count_on_from_what_they_were_set_to(talk, axis):
    talk.send(long(0x0410, struct.pack("<Hi", 1, 1_000_000)), 0.0)
    talk.send(long(0x0409, struct.pack("<Hi", 1, -7)), 0.0)
    talk.send(move_absolute(1_136_533), 1.0)
    assert status(talk, 10.0)[:2] == (1_136_533, 136_526)
    assert_allclose(axis.position_deg(10.0), 1.0, rtol=1e-5)


def test_no_stage_turns_faster_than_it_can(talk, axis):
    fast = struct.pack("<Hiii", 1, 0, 15020, 2_000_000_000)
    talk.send(long(0x0413, fast) + TO_45_DEG, 0.0)
    assert_allclose(axis.velocity_deg_s(3.0), 10.0)


@pytest.mark.parametrize("word", [0, -5])
def test_a_velocity_that_is_none_moves_nothing_visibly(talk, axis, word):
    talk.send(long(0x0413, struct.pack("<Hiii", 1, 0, word, word)) + TO_45_DEG, 0.0)
    assert talk.hear(1e4) == []
    assert abs(axis.position_deg(1e4)) < 0.1


def test_updates_come_ten_times_a_second_until_they_are_stopped(talk):
    talk.send(START_UPDATES, 0.0)
    heard = talk.hear(10.04)
    assert numbers(heard) == [0x0481] * 100
    assert_allclose([heard[0][0], heard[-1][0]], [0.1, 10.0], atol=0.01)
    talk.send(STOP_UPDATES, 10.04)
    assert talk.hear(20.0) == []


def test_starting_updates_twice_does_not_double_them(talk):
    talk.send(START_UPDATES, 0.0)
    talk.send(START_UPDATES, 0.05)
    assert len(talk.hear(1.1)) == 10


def test_updates_and_ends_come_between_each_other(talk):
    talk.send(START_UPDATES + move_absolute(136_533), 0.0)
    found = numbers(talk.hear(2.0))
    assert found.count(0x0464) == 1
    assert found.index(0x0464) == 6
    assert len(found) == 20


def test_a_servo_ceases_to_tell_what_nobody_acknowledges(converse, kdc101):
    talk = converse(kdc101)
    talk.send(START_UPDATES, 0.0)
    assert numbers(talk.hear(60.0)) == [0x0491] * 50
    talk.send(START_UPDATES, 60.0)
    for second in range(61, 70):
        talk.send(short(0x0492, 0), float(second))
        assert len(talk.hear(float(second) + 0.05)) in (10, 11)


def test_a_servo_tells_its_own_kind_of_status(converse, kdc101):
    talk = converse(kdc101)
    talk.send(move_absolute(round(90 * KDC101_PRM1Z8.counts_per_deg)), 0.0)
    talk.send(REQ_STATUS, 2.0)
    assert talk.hear(2.01) == []
    talk.send(REQ_SERVO_STATUS, 2.01)
    ((_, message),) = talk.hear(2.02)
    assert message[:6] == b"\x91\x04\x0e\x00\x81\x50"
    channel, position, velocity, _, bits = struct.unpack("<HiHHI", message[6:])
    # 2 s at 25 deg/s and 25 deg/s²: 37.5 deg, and 25 x 42941.66 / 65536 steps a sampling interval
    assert_allclose(position / KDC101_PRM1Z8.counts_per_deg, 37.7, atol=0.3)
    assert (channel, velocity, bits) == (1, 16, 0x9000_0110)
    ((_, message),) = talk.hear(60.0)
    assert message[:2] == b"\x64\x04"
    assert struct.unpack("<HiHHI", message[6:]) == (1, 172_768, 0, 0, 0x9000_2100)


def test_a_rack_answers_at_its_motherboard_and_at_the_bays_it_has(converse, rack):
    talk = converse(rack)
    talk.send(b"".join(short(0x0060, bay, destination=0x11) for bay in range(10)), 0.0)
    used = [(message[2], message[3]) for _, message in talk.hear(1.0)]
    assert used == [(bay, 1 if bay in (0, 2) else 2) for bay in range(10)]
    talk.send(short(0x0005, 0, destination=0x11), 1.0)
    ((_, message),) = talk.hear(2.0)
    assert message[5] == 0x11
    assert struct.unpack_from("<8s", message, 10)[0].rstrip(b"\0") == b"BSC203"
    for address in (0x11, 0x22, 0x24, 0x50):
        talk.send(short(0x0480, destination=address), 2.0)
    assert talk.hear(3.0) == []
    talk.send(short(0x0480, destination=0x23), 3.0)
    ((_, message),) = talk.hear(4.0)
    assert message[4:6] == b"\x81\x23"


def test_bays_move_on_their_own(converse):
    axes = {1: Axis(BSC200_HDR50.step_deg), 2: Axis(BSC200_HDR50.step_deg)}
    talk = converse(ThorlabsApt(BSC200_HDR50, axes))
    talk.send(move_absolute(75091, destination=0x21) + move_absolute(-3 * 75091, destination=0x22), 0.0)
    heard = talk.hear(10.0)
    assert [(message[1], message[5]) for _, message in heard] == [(4, 0x21), (4, 0x22)]
    assert_allclose([axis.position_deg(10.0) for axis in axes.values()], [1.0, -3.0])


def test_updates_asked_of_the_motherboard_come_from_every_bay(converse, rack):
    talk = converse(rack)
    talk.send(short(0x0011, 0, destination=0x11), 0.0)
    assert [message[5] for _, message in talk.hear(0.25)] == [0x21, 0x23, 0x21, 0x23]
    talk.send(short(0x0012, 0, destination=0x21), 0.25)
    assert [message[5] for _, message in talk.hear(0.45)] == [0x23, 0x23]


@pytest.mark.parametrize(("model", "bays"), [(K10CR1, [2]), (K10CR1, [1, 2]), (BSC200_HDR50, [4]), (BSC200_HDR50, [])])
def test_a_controller_has_no_other_bays(model, bays):
    with pytest.raises(ValueError, match="cannot have stages"):
        ThorlabsApt(model, dict.fromkeys(bays, Axis(0.01)))


def test_state_outlives_the_client_and_unfinished_messages_do_not(k10cr1, converse):
    first = converse(k10cr1)
    first.send(TO_45_DEG + TO_45_DEG[:7], 0.0)
    assert status(converse(k10cr1), 20.0)[0] == 6_144_000


def test_a_power_cycle_loses_home_and_settings_but_not_the_place(k10cr1, talk, axis):
    talk.send(HOME, 0.0)
    talk.hear(10.0)
    talk.send(long(0x043A, struct.pack("<Hi", 1, 99)) + TO_45_DEG, 10.0)
    k10cr1.power_cycle(12.0)
    assert talk.hear(60.0) == []
    position, _, bits = status(talk, 60.0)
    assert (position, bits & (HOMED | MOVING)) == (0, 0)
    assert_allclose(axis.position_deg(60.0), 15.0, atol=0.1)
    talk.send(short(0x043B), 61.0)
    assert talk.hear(62.0)[0][1][6:] == struct.pack("<Hi", 1, 0)


def test_a_message_whose_rest_does_not_come_is_given_up(k10cr1):
    session = k10cr1.session()
    assert session.receive(TO_45_DEG[:8], 0.0) == []
    ((_, answer),) = session.receive(REQ_STATUS, 2.0)
    assert struct.unpack_from("<i", answer, 8)[0] == 0


def test_noise_neither_stops_the_controller_nor_fills_its_memory(k10cr1):
    source = random.Random(1)
    good = [REQ_STATUS, HOME, TO_45_DEG, STOP, short(0x0005), long(0x0413, bytes(14)), short(0x0429)]
    session, now_s = k10cr1.session(), 0.0
    for _ in range(20_000):
        frame = bytearray(source.choice(good))
        for _ in range(source.randrange(3)):
            frame[source.randrange(len(frame))] = source.randrange(256)
        session.receive(bytes(frame[: source.randrange(len(frame)) + 1]), now_s)
        now_s += 0.001
    assert len(session._reader._received) < 600
    ((_, answer),) = session.receive(short(0x0211), now_s + 1.0)
    assert answer[:2] == b"\x12\x02"


def test_a_reader_finds_a_message_behind_any_noise_that_is_no_message():
    source = random.Random(2)
    for _ in range(2000):
        # no noise below looks like an address, so none of it can be a header
        noise = bytes(source.choice(b"\x00\x02\x7f\x60\x40") for _ in range(source.randrange(40)))
        assert AptReader().feed(noise + HOME, 0.0)[-1] == AptMessage(0x0443, 0x50, 1, (1, 0))
