"""What ends the travel of a stage on a simulated APT controller, and how the controller tells it."""

import struct

import pytest
from numpy.testing import assert_allclose

from sim_devices.axis import Axis
from sim_devices.thorlabs_apt.controller import ThorlabsApt
from sim_devices.thorlabs_apt.models import BSC200_HDR50, K10CR1, KDC101_PRM1Z8, replace

CLOCKWISE, COUNTER_CLOCKWISE, SOFT_CLOCKWISE, SOFT_COUNTER_CLOCKWISE = 0x1, 0x2, 0x4, 0x8
ALL = 0xF
HOMED, SETTLED, OVERLOAD, ERROR, ENABLED = 0x400, 0x2000, 0x100_0000, 0x4000_0000, 0x8000_0000
IGNORED, MAKES, BREAKS, HOMING_ONLY = 1, 2, 3, 4
COMPLETED, STOPPED, RICH_FAULT = 0x0464, 0x0466, 0x0081
HOME = b"\x43\x04\x01\x00\x50\x01"


def counts(degrees, model=K10CR1):
    return round(degrees * model.counts_per_deg)


def long(number, layout, *values, destination=0x50):
    data = struct.pack(layout, *values)
    return struct.pack("<HHBB", number, len(data), destination | 0x80, 1) + data


def move_to(degrees, model=K10CR1, **addresses):
    return long(0x0453, "<Hi", 1, counts(degrees, model), **addresses)


def switches(clockwise, counter_clockwise, soft=(0, 0), soft_mode=1):
    return long(0x0423, "<HHHiiH", 1, clockwise, counter_clockwise, *soft, soft_mode)


@pytest.fixture
def stage(converse):
    """A controller with one stage, and a client of it."""

    def make(model=K10CR1, start_deg=0.0):
        axis = Axis(model.step_deg, start_deg)
        controller = ThorlabsApt(model, {1: axis})
        return controller, axis, converse(controller)

    return make


def ends(talk, until_s):
    """Numbers of the messages that were heard, with the position in counts and the status bits that they tell."""
    heard = [(told_s, message) for told_s, message in talk.hear(until_s) if len(message) == 20]
    return [
        (told_s, int.from_bytes(message[:2], "little"), *struct.unpack_from("<i", message, 8), bits(message))
        for told_s, message in heard
    ]


def bits(message):
    return struct.unpack_from("<I", message, 16)[0]


def status_bits(talk, now_s):
    talk.hear(now_s)
    talk.send(b"\x29\x04\x01\x00\x50\x01", now_s)
    ((_, message),) = talk.hear(now_s + 0.005)
    return struct.unpack_from("<I", message, 8)[0]


@pytest.mark.parametrize(
    ("start_deg", "bit"), [(-4.0, 1), (-4.2, 1), (-3.8, 1), (356.0, 1), (-4.3, 0), (-3.7, 0), (0.0, 0), (176.0, 0)]
)
def test_a_stage_that_stands_on_its_switch_says_so(stage, start_deg, bit):
    _, _, talk = stage(start_deg=start_deg)
    assert status_bits(talk, 1.0) & ALL == bit


def test_the_switch_is_on_the_reverse_side_whichever_way_round_that_is(stage):
    _, _, talk = stage(KDC101_PRM1Z8, start_deg=-4.0)
    assert status_bits(talk, 1.0) & ALL == COUNTER_CLOCKWISE


@pytest.mark.parametrize("mode", [IGNORED, HOMING_ONLY])
def test_a_switch_for_homing_lets_moves_pass(stage, mode):
    _, axis, talk = stage()
    talk.send(switches(mode, mode) + move_to(-20.0), 0.0)
    ((_, number, position, told),) = ends(talk, 60.0)
    assert (number, position, told & ALL) == (COMPLETED, counts(-20.0), 0)
    assert_allclose(axis.motor_deg(60.0), -20.0, atol=1e-5)


@pytest.mark.parametrize("mode", [MAKES, BREAKS, MAKES | 0x80])
def test_a_switch_that_stops_ends_a_move_at_once_and_it_is_told_as_stopped(stage, mode):
    _, axis, talk = stage(start_deg=10.0)
    talk.send(switches(mode, IGNORED) + move_to(-60.0), 0.0)
    ((told_s, number, position, told),) = ends(talk, 60.0)
    # counted from where it was switched on: 13.75 deg back to the switch, at 10 deg/s² up to 10 deg/s
    assert_allclose(told_s, 1.0 + 8.75 / 10, atol=0.01)
    assert (number, told & (ALL | SETTLED)) == (STOPPED, CLOCKWISE | SETTLED)
    assert_allclose(position / K10CR1.counts_per_deg, -13.75, atol=0.001)
    assert_allclose(axis.motor_deg(60.0), -3.75, atol=0.001)


def test_from_the_switch_there_is_no_way_further_on_but_one_back(stage):
    _, axis, talk = stage(start_deg=-4.0)
    talk.send(switches(MAKES, IGNORED) + move_to(-1.0), 0.0)
    ((told_s, number, _, told),) = ends(talk, 10.0)
    assert told_s < 0.1
    assert (number, told & ALL) == (STOPPED, CLOCKWISE)
    assert axis.motor_deg(10.0) == pytest.approx(-4.0, abs=1e-3)
    talk.send(move_to(20.0), 10.0)
    ((_, number, position, told),) = ends(talk, 30.0)
    assert (number, position, told & ALL) == (COMPLETED, counts(20.0), 0)


def test_a_motion_forward_passes_the_switch_that_is_met_in_reverse(stage):
    _, axis, talk = stage(start_deg=-10.0)
    talk.send(switches(MAKES, IGNORED) + move_to(20.0), 0.0)
    assert [number for _, number, *_ in ends(talk, 30.0)] == [COMPLETED]
    assert_allclose(axis.motor_deg(30.0), 10.0, atol=1e-5)


@pytest.mark.parametrize("mode", [IGNORED, MAKES, HOMING_ONLY])
@pytest.mark.parametrize(("start_deg", "home_deg"), [(30.0, 0.0), (-3.9, 0.0), (-10.0, -360.0)])
def test_homing_ends_behind_the_switch_whatever_else_that_does(stage, mode, start_deg, home_deg):
    _, axis, talk = stage(start_deg=start_deg)
    talk.send(switches(mode, IGNORED) + HOME, 0.0)
    assert [message[:2] for _, message in talk.hear(60.0)] == [b"\x44\x04"]
    assert_allclose(axis.motor_deg(60.0), home_deg, atol=1e-5)
    assert status_bits(talk, 60.0) & (HOMED | ALL) == HOMED


def test_the_switch_is_seen_while_home_is_searched(stage):
    _, axis, talk = stage(start_deg=2.0)
    talk.send(HOME, 0.0)
    on_switch_s = next(0.01 * tick for tick in range(1000) if abs(axis.motor_deg(0.01 * tick) + 4.0) < 0.1)
    assert status_bits(talk, on_switch_s) & ALL == CLOCKWISE


@pytest.mark.parametrize(
    ("model", "soft_deg", "target_deg", "limit_deg", "bit"),
    [
        (K10CR1, (-30.0, 50.0), 80.0, 50.0, SOFT_COUNTER_CLOCKWISE),
        (K10CR1, (-30.0, 50.0), -80.0, -30.0, SOFT_CLOCKWISE),
        (KDC101_PRM1Z8, (50.0, -30.0), 80.0, 50.0, SOFT_CLOCKWISE),
    ],
)
@pytest.mark.parametrize(("mode", "brakes_s"), [(2, 0.0), (3, 1.0)])
def test_a_limit_in_counts_ends_a_move(stage, model, soft_deg, target_deg, limit_deg, bit, mode, brakes_s):
    model = replace(model, velocity_deg_s=10.0, acceleration_deg_s2=10.0)
    _, _, talk = stage(model)
    soft = tuple(counts(limit, model) for limit in soft_deg)
    talk.send(switches(1, 1, soft, mode) + move_to(target_deg, model), 0.0)
    ((told_s, number, position, told),) = ends(talk, 60.0)
    assert (number, told & ALL) == (STOPPED, bit)
    assert_allclose(position / model.counts_per_deg, limit_deg, atol=0.002)
    # half a second lost on getting up to speed, and as much on stopping as it should
    assert_allclose(told_s, abs(limit_deg) / 10 + 0.5 + brakes_s / 2, atol=0.01)
    talk.send(move_to(limit_deg / 2, model), 60.0)
    assert [(number, told & ALL) for _, number, _, told in ends(talk, 120.0)] == [(COMPLETED, 0)]


@pytest.mark.parametrize(("soft", "mode"), [((-1000, 1000), 1), ((0, 0), 2), ((1000, -1000), 3)])
def test_limits_that_are_off_or_none_limit_nothing(stage, soft, mode):
    _, _, talk = stage()
    talk.send(switches(1, 1, soft, mode) + move_to(5.0), 0.0)
    assert [(number, told & ALL) for _, number, _, told in ends(talk, 60.0)] == [(COMPLETED, 0)]


def test_a_k10cr1_turns_no_further_than_43_turns(stage):
    _, axis, talk = stage()
    talk.send(move_to(15_500.0), 0.0)
    ((_, number, position, told),) = ends(talk, 4000.0)
    assert (number, position, told & ALL) == (STOPPED, counts(15_480.0), SOFT_COUNTER_CLOCKWISE)
    talk.send(b"\x57\x04\x01\x01\x50\x01", 4000.0)
    assert_allclose(axis.motor_deg(5000.0), 15_480.0)


def test_a_limit_switch_in_the_way_is_told_to_all_clients_at_once(stage):
    controller, axis, talk = stage()
    heard = []
    controller.tell = lambda time_s, message: heard.append((time_s, message))
    talk.send(move_to(45.0), 0.0)
    controller.hit_limit(axis, 2.0)
    ((told_s, message),) = heard
    assert (told_s, message[:6]) == (2.0, b"\x66\x04\x0e\x00\x81\x50")
    assert talk.hear(60.0) == []
    assert status_bits(talk, 60.0) & (ALL | SETTLED | ENABLED) == COUNTER_CLOCKWISE | SETTLED | ENABLED
    talk.send(move_to(5.0), 61.0)
    assert [(number, told & ALL) for _, number, _, told in ends(talk, 90.0)] == [(COMPLETED, 0)]


def test_a_lost_home_is_seen_in_the_status(stage):
    controller, axis, talk = stage()
    talk.send(HOME, 0.0)
    talk.hear(20.0)
    talk.send(move_to(30.0), 20.0)
    talk.hear(40.0)
    controller.lose_home(axis, 40.0)
    talk.send(b"\x80\x04\x01\x00\x50\x01", 41.0)
    ((_, message),) = talk.hear(42.0)
    assert (struct.unpack_from("<i", message, 8)[0], bits(message) & HOMED) == (0, 0)


@pytest.mark.parametrize(
    ("explains", "message"),
    [
        (True, struct.pack("<HHBBHH64s", RICH_FAULT, 68, 0x81, 0x22, 0, 1, b"Motor overload")),
        (False, b"\x80\x00\x00\x00\x01\x22"),
    ],
)
def test_an_overload_is_reported_and_takes_the_power_until_the_channel_is_enabled(converse, explains, message):
    axes = {number: Axis(BSC200_HDR50.step_deg) for number in (1, 2)}
    rack, heard = ThorlabsApt(replace(BSC200_HDR50, explains_faults=explains), axes), []
    rack.tell = lambda time_s, data: heard.append((time_s, data))
    talk = converse(rack)
    move = move_to(45.0, BSC200_HDR50, destination=0x22)
    talk.send(move, 0.0)
    rack.overload(axes[2], 0.5)
    assert heard == [(0.5, message)]

    def status(now_s):
        talk.hear(now_s)
        talk.send(b"\x29\x04\x01\x00\x22\x01", now_s)
        return struct.unpack_from("<I", talk.hear(now_s + 0.005)[0][1], 8)[0] & (OVERLOAD | ERROR | ENABLED)

    assert status(1.0) == OVERLOAD | ERROR
    stands_deg = axes[2].motor_deg(1.0)
    talk.send(move, 2.0)
    assert talk.hear(20.0) == []
    talk.send(b"\x10\x02\x01\x01\x22\x01" + move, 20.0)
    assert len(talk.hear(40.0)) == 1
    assert status(40.0) == ENABLED
    assert axes[2].motor_deg(40.0) != stands_deg
