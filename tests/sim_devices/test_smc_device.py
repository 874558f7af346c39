"""The simulated SMC LEC controller speaks Modbus RTU and moves its table as its fact sheet says."""

import struct

import pytest
from numpy.testing import assert_allclose

from sim_devices.axis import Axis
from sim_devices.modbus.rtu import crc16
from sim_devices.smc_lec.controller import SmcLec

HOLD, SVON, DRIVE, RESET, SETUP, JOG_MINUS, JOG_PLUS, SERIAL = 0x18, 0x19, 0x1A, 0x1B, 0x1C, 0x1D, 0x1E, 0x30
BUSY, SVRE, SETON, INP, AREA, ESTOP, ALARM = 0x48, 0x49, 0x4A, 0x4B, 0x4C, 0x4E, 0x4F


def framed(text):
    """A frame from hexadecimal text, its checksum added."""
    body = bytes.fromhex(text)
    return body + crc16(body)


class Host:
    """The other end of the wire, as a few lines of Modbus."""

    def __init__(self, session):
        self.session = session

    def exchange(self, body, now_s):
        ((_, reply),) = self.session.receive(body + crc16(body), now_s)
        assert crc16(reply[:-2]) == reply[-2:]
        return reply[:-2]

    def set(self, coil, state, now_s):
        return self.exchange(struct.pack(">BBHH", 1, 5, coil, 0xFF00 * state), now_s)

    def inputs(self, now_s):
        bits = int.from_bytes(self.exchange(struct.pack(">BBHH", 1, 2, 0x40, 16), now_s)[3:], "little")
        return {0x40 + place for place in range(16) if bits >> place & 1}

    def registers(self, address, count, now_s):
        reply = self.exchange(struct.pack(">BBHH", 1, 3, address, count), now_s)
        return list(struct.unpack(f">{count}H", reply[3:]))

    def position_deg(self, now_s):
        reply = self.exchange(struct.pack(">BBHH", 1, 3, 0x9000, 2), now_s)
        return struct.unpack(">i", reply[3:])[0] / 100

    def write(self, address, values, now_s):
        header = struct.pack(">BBHHB", 1, 0x10, address, len(values), 2 * len(values))
        return self.exchange(header + struct.pack(f">{len(values)}H", *values), now_s)

    def prepare(self, position_deg, now_s, *, mode=1, speed=30, accel=100, decel=100, area=(0, 0), width=0):
        longs = [round(100 * value) for value in (position_deg, *area, width)]
        data = struct.pack(">HHiHHHHHHiii", mode, speed, longs[0], accel, decel, 0, 0, 0, 100, *longs[1:])
        self.write(0x9102, struct.unpack(">16H", data), now_s)

    def move(self, position_deg, now_s, **how):
        self.prepare(position_deg, now_s, **how)
        self.write(0x9100, [0x0100], now_s)


@pytest.fixture
def table():
    return Axis(0.01)


@pytest.fixture
def controller(table):
    return SmcLec(1, table)


@pytest.fixture
def fresh(controller):
    """A host of a controller that has just been switched on."""
    return Host(controller.session())


@pytest.fixture
def host(fresh):
    """A host of a controller whose table is homed, at 10 s."""
    fresh.set(SERIAL, 1, 0.0)
    fresh.set(SVON, 1, 0.0)
    fresh.set(SETUP, 1, 1.0)
    fresh.set(SETUP, 0, 5.0)
    return fresh


FRAMES = [
    (bytes.fromhex("01 05 00 19 FF 00 5D FD"), bytes.fromhex("01 05 00 19 FF 00 5D FD")),
    (bytes.fromhex("01 10 91 00 00 01 02 01 00 27 09"), framed("01 10 91 00 00 01")),
    (bytes.fromhex("01 03 90 00 00 02 E9 0B"), framed("01 03 04 00 00 00 00")),
    (framed("01 08 00 00 A5 37"), framed("01 08 00 00 A5 37")),
    (framed("01 01 00 10 00 30"), framed("01 01 06 00 00 00 00 00 00")),
    (framed("01 02 00 40 00 10"), framed("01 02 02 00 00")),
    (
        framed("01 0F 00 30 00 01 01 01") + framed("01 01 00 30 00 01"),
        framed("01 0F 00 30 00 01") + framed("01 01 01 01"),
    ),
    # step number 5, HOLD and serial mode in one message; gaps stay 0
    (
        framed("01 0F 00 10 00 21 05 C5 01 00 00 01") + framed("01 01 00 10 00 21"),
        framed("01 0F 00 10 00 21") + framed("01 01 05 05 01 00 00 01"),
    ),
    # functions that it does not know
    (framed("01 06 91 02 00 01"), framed("01 86 01")),
    (framed("01 04 90 00 00 02"), framed("01 84 01")),
    (framed("01 17 90 00 00 02 91 02 00 01 02 00 01"), framed("01 97 01")),
    # addresses: outside the blocks, across their ends, of the other kind, read-only, half a number
    (framed("01 01 00 0F 00 01"), framed("01 81 02")),
    (framed("01 01 00 3F 00 02"), framed("01 81 02")),
    (framed("01 02 00 10 00 01"), framed("01 82 02")),
    (framed("01 05 00 48 FF 00"), framed("01 85 02")),
    (framed("01 03 91 1F 00 02"), framed("01 83 02")),
    (framed("01 10 90 04 00 02 04 00 00 00 00"), framed("01 90 02")),
    (framed("01 03 90 00 00 01"), framed("01 83 02")),
    (framed("01 03 90 01 00 01"), framed("01 83 02")),
    (framed("01 10 91 04 00 01 02 00 00"), framed("01 90 02")),
    # values
    (framed("01 05 00 19 00 01"), framed("01 85 03")),
    (framed("01 0F 00 30 00 09 01 01"), framed("01 8F 03")),
    (framed("01 01 00 10 00 00"), framed("01 81 03")),
    # the whole of both blocks, gaps read 0
    (framed("01 03 90 06 00 7D"), framed("01 03 FA" + "00" * 250)),
    (framed("01 03 90 A3 00 7D"), framed("01 03 FA" + "00" * 250)),
    # others' frames: a request, a long request, and both their replies
    (framed("02 03 90 00 00 02") + framed("02 03 04 00 00 3A 98") + framed("01 01 00 30 00 01"), framed("01 01 01 00")),
    (framed("02 10 91 00 00 01 02 01 00") + framed("02 10 91 00 00 01"), b""),
    (framed("02 83 02") + framed("01 01 00 30 00 01"), framed("01 01 01 00")),
    (b"\xff\x01" + framed("01 01 00 30 00 01"), framed("01 01 01 00")),
]


@pytest.mark.parametrize(("request_", "reply"), FRAMES)
def test_frames_are_answered(controller, feed, request_, reply):
    replies = feed(controller.session(), request_, trailing=b"\x01\x01\x00")
    assert b"".join(text for _, text in replies) == reply


def test_the_position_of_the_sheet(host, table):
    host.move(150, 10.0)
    reply = host.session.receive(bytes.fromhex("01 03 90 00 00 02 E9 0B"), 30.0)[0][1]
    assert reply == bytes.fromhex("01 03 04 00 00 3A 98 E9 39")
    assert table.position_deg(30.0) == 150


def test_a_reply_takes_the_time_of_both_frames_and_four_milliseconds(controller):
    ((due_s, _),) = controller.session().receive(framed("01 03 90 00 00 02"), 2.0)
    assert_allclose(due_s, 2.004 + (8 + 3.5 + 9) * 10 / 38_400)


def test_coils_do_nothing_before_serial_mode(fresh):
    fresh.set(SVON, 1, 0.0)
    assert fresh.inputs(5.0) == set()
    fresh.set(SERIAL, 1, 5.0)
    assert fresh.inputs(10.0) == set()
    assert fresh.exchange(struct.pack(">BBHH", 1, 1, SVON, 1), 10.0)[3:] == b"\0"


def test_the_servo_takes_a_moment(fresh):
    fresh.set(SERIAL, 1, 0.0)
    fresh.set(SVON, 1, 1.0)
    assert fresh.inputs(1.2) == set()
    assert fresh.inputs(1.3) == {SVRE}
    fresh.set(SVON, 0, 2.0)
    assert fresh.inputs(2.0) == set()


def test_the_return_to_origin_is_busy_and_finds_it(fresh, table):
    table.move(12.0, -100.0, velocity_deg_s=50, acceleration_deg_s2=50, deceleration_deg_s2=50)
    fresh.set(SERIAL, 1, 0.0)
    fresh.set(SVON, 1, 0.0)
    fresh.set(SETUP, 1, 1.0)
    # 12/20 + 20/1000 s and 0.5 s of search
    assert fresh.inputs(2.1) == {SVRE, BUSY}
    assert fresh.inputs(2.13) == {SVRE, SETON, INP}
    assert fresh.position_deg(2.13) == table.position_deg(2.13) == 0


def test_a_return_begins_when_its_coil_rises_only(host):
    assert host.inputs(5.0) == {SVRE, SETON, INP}
    host.set(SETUP, 1, 6.0)
    assert host.inputs(6.1) == {SVRE, BUSY}


def test_a_reset_without_alarm_leaves_the_servo_alone(host):
    host.move(60, 10.0)
    host.set(RESET, 1, 10.5)
    assert SVRE in host.inputs(10.5)
    assert host.position_deg(20.0) == 60


def test_a_start_without_serial_mode_is_not_taken(host):
    host.set(SERIAL, 0, 9.0)
    host.move(60, 10.0)
    assert host.registers(0x9100, 1, 20.0) == [0x0100]
    assert host.inputs(20.0) == {SVRE, SETON, INP}
    assert host.position_deg(20.0) == 0


def test_an_operation_is_taken_and_is_a_trapezoid(host, table):
    host.move(60, 10.0)
    assert host.registers(0x9100, 1, 10.005) == [0x0100]
    assert host.registers(0x9100, 1, 10.011) == [0]
    assert host.inputs(10.1) == {SVRE, SETON, BUSY}
    assert host.registers(0x9002, 2, 11.0) == [30, 0]
    assert host.registers(0x9004, 3, 11.0) == [0, 6000, 0]
    # 60/30 + 30/100 s
    assert BUSY in host.inputs(12.299)
    assert host.inputs(12.3) == {SVRE, SETON, INP}
    assert host.position_deg(12.3) == table.position_deg(12.3) == 60


def test_accelerations_differ(host):
    host.move(60, 10.0, accel=50, decel=200)
    arrival_s = 10 + 60 / 30 + 15 / 50 + 15 / 200
    assert BUSY in host.inputs(arrival_s - 0.001)
    assert BUSY not in host.inputs(arrival_s + 0.001)


@pytest.mark.parametrize(
    ("mode", "start", "end"),
    [(0x0001, 0x0001, -30), (0x0100, 0x0100, -30), (0x0002, 0x0100, 10), (0x0200, 0x0001, 10)],
)
def test_mode_and_start_may_be_in_either_byte(host, mode, start, end):
    host.move(40, 10.0)
    host.prepare(-30, 15.0, mode=mode)
    host.write(0x9100, [start], 15.0)
    assert host.position_deg(30.0) == end


def test_everything_in_one_message_starts_last(host):
    data = struct.pack(">HHHHiHHHHHHiii", 0x0100, 0, 1, 30, 2500, 100, 100, 0, 0, 0, 100, 0, 0, 0)
    host.write(0x9100, struct.unpack(">18H", data), 10.0)
    assert host.position_deg(20.0) == 25


def test_a_start_while_busy_is_not_taken(host):
    host.move(60, 10.0)
    host.move(-60, 11.0)
    assert host.registers(0x9100, 1, 20.0) == [0x0100]
    assert host.position_deg(20.0) == 60


def test_hold_decelerates_and_keeps_the_target(host):
    host.move(60, 10.0)
    host.set(HOLD, 1, 11.0)
    assert BUSY in host.inputs(11.29)
    assert host.inputs(11.31) == {SVRE, SETON}
    # 30 · 1 - 4.5 deg, and 4.5 deg to stop
    assert host.position_deg(11.31) == 30
    assert host.registers(0x9004, 2, 11.31) == [0, 6000]
    host.move(0, 12.0)
    assert host.registers(0x9100, 1, 13.0) == [0x0100]
    host.set(HOLD, 0, 14.0)
    assert host.position_deg(20.0) == 60


def test_a_held_return_to_origin_goes_on(fresh, table):
    table.move(90.0, -100.0, velocity_deg_s=50, acceleration_deg_s2=50, deceleration_deg_s2=50)
    fresh.set(SERIAL, 1, 0.0)
    fresh.set(SVON, 1, 0.0)
    fresh.set(SETUP, 1, 1.0)
    fresh.set(HOLD, 1, 2.0)
    assert fresh.inputs(10.0) == {SVRE}
    fresh.set(HOLD, 0, 10.0)
    assert fresh.inputs(20.0) == {SVRE, SETON, INP}


def test_without_torque_the_target_is_gone(host):
    host.move(60, 10.0)
    host.set(SVON, 0, 11.0)
    host.set(SVON, 1, 12.0)
    # 30 - 4.5 deg, and 30²/6000 deg of braking
    assert_allclose(host.position_deg(13.0), 25.65, atol=0.011)
    assert host.inputs(13.0) == {SVRE, SETON, INP}
    assert host.position_deg(30.0) == host.position_deg(13.0)


@pytest.mark.parametrize(
    "how",
    [
        {"position_deg": 200},
        {"position_deg": -181},
        {"speed": 0},
        {"speed": 421},
        {"accel": 0},
        {"accel": 3001},
        {"decel": 0},
        {"mode": 3},
    ],
)
def test_an_impossible_operation_is_an_alarm_until_it_is_reset(host, how):
    host.move(**({"position_deg": 30, "now_s": 10.0} | how))
    assert host.inputs(10.5) == {SETON, ALARM}
    assert host.position_deg(15.0) == 0
    host.set(RESET, 1, 16.0)
    host.set(RESET, 0, 16.1)
    assert host.inputs(16.5) == {SVRE, SETON, INP}
    host.move(30, 17.0)
    assert host.position_deg(20.0) == 30


def test_a_start_without_origin_or_torque_is_an_alarm(fresh):
    fresh.set(SERIAL, 1, 0.0)
    fresh.set(SVON, 1, 0.0)
    fresh.move(30, 1.0)
    assert ALARM in fresh.inputs(1.1)
    fresh.set(RESET, 1, 2.0)
    fresh.set(SVON, 0, 3.0)
    fresh.set(SETUP, 1, 4.0)
    assert ALARM in fresh.inputs(4.1)


def test_no_step_is_stored(host):
    host.set(DRIVE, 1, 10.0)
    assert ALARM in host.inputs(10.1)


def test_jogging_lasts_as_long_as_its_coil_is_on(host):
    host.set(JOG_PLUS, 1, 10.0)
    host.set(JOG_PLUS, 0, 12.0)
    assert_allclose(host.position_deg(15.0), 20.0, atol=0.011)
    host.set(JOG_MINUS, 1, 20.0)
    assert host.position_deg(60.0) == -180
    host.set(JOG_MINUS, 0, 60.0)
    host.move(0, 61.0)
    host.set(JOG_PLUS, 1, 61.1)
    host.set(JOG_PLUS, 0, 61.2)
    assert host.position_deg(90.0) == 0


def test_in_position_and_area(host):
    host.move(60, 10.0, area=(59, 70), width=2)
    # the way that is left is 50 deg/s² times the square of the time that is left: 2 deg 0.2 s, 1 deg 0.141 s before
    assert {BUSY, INP, AREA} & host.inputs(12.3 - 0.21) == {BUSY}
    assert {BUSY, INP, AREA} & host.inputs(12.3 - 0.19) == {BUSY, INP}
    assert {BUSY, INP, AREA} & host.inputs(12.3 - 0.13) == {BUSY, INP, AREA}


def test_a_protection_takes_the_torque(host, controller):
    host.move(60, 10.0)
    controller.trip(11.0)
    assert host.inputs(11.5) == {SETON, ALARM}
    assert host.position_deg(20.0) < 30


def test_the_alarm_may_be_zero(table):
    controller = SmcLec(1, table, alarm_is_one=False)
    host = Host(controller.session())
    assert host.inputs(0.0) == {ALARM}
    controller.trip(1.0)
    assert host.inputs(1.0) == set()


def test_the_emergency_stop_shows_and_stops(host, controller):
    host.move(60, 10.0)
    controller.emergency(True, 11.0)
    assert host.inputs(11.5) == {SETON, ESTOP}
    host.move(60, 12.0)
    assert host.inputs(12.5) == {SETON, ESTOP}
    controller.emergency(False, 13.0)
    assert host.inputs(13.4) == {SVRE, SETON, INP}
    assert host.position_deg(20.0) < 30


def test_without_power_everything_but_the_table_is_forgotten(host, controller, table):
    host.move(60, 10.0)
    controller.power_cycle(20.0)
    assert host.inputs(20.0) == set()
    assert host.registers(0x9102, 2, 20.0) == [0, 0]
    assert host.position_deg(20.0) == 0
    assert table.position_deg(20.0) == 60


def test_state_belongs_to_the_controller(host, controller):
    host.move(60, 10.0)
    assert Host(controller.session()).position_deg(20.0) == 60
