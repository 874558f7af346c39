"""The simulated AZ drive speaks Modbus RTU and moves as its fact sheet says."""

import struct

import pytest
from numpy.testing import assert_allclose

from sim_devices.axis import Axis
from sim_devices.modbus.rtu import crc16
from sim_devices.oriental_az.drive import OrientalAz

STATUS, POSITION, DIRECT, INPUT, ONE_SHOT = 0x007E, 0x00CC, 0x0058, 0x007C, 0x0074
HOME_END, READY, ALARM, MOVE, IN_POS = 1 << 4, 1 << 5, 1 << 7, 1 << 13, 1 << 14
START, ZHOME, STOP, FREE, ALM_RST, FW_JOG, FW_POS, RV_POS = (1 << bit for bit in (3, 4, 5, 6, 7, 12, 14, 15))


def framed(text):
    """A frame from hexadecimal text, its checksum added."""
    body = bytes.fromhex(text)
    return body + crc16(body)


class Host:
    """The other end of the wire, as a few lines of Modbus."""

    def __init__(self, session):
        self.session = session

    def exchange(self, body, now_s):
        replies = self.session.receive(body + crc16(body), now_s)
        assert len(replies) == 1
        assert crc16(replies[0][1][:-2]) == replies[0][1][-2:]
        return replies[0][1][:-2]

    def read(self, address, now_s=0.0):
        return struct.unpack(">i", self.exchange(struct.pack(">BBHH", 1, 3, address, 2), now_s)[3:])[0]

    def write(self, address, *values, now_s=0.0):
        data = struct.pack(f">{len(values)}i", *values)
        header = struct.pack(">BBHHB", 1, 0x10, address, 2 * len(values), len(data))
        return self.exchange(header + data, now_s)

    def move(self, kind, position, now_s, *, speed=2000, rate=10_000, stop_rate=10_000):
        self.write(DIRECT, 0, kind, position, speed, rate, stop_rate, 1000, 1, now_s=now_s)

    def has(self, bits, now_s):
        return self.read(STATUS, now_s) & bits == bits


@pytest.fixture
def table():
    return Axis(0.02)


@pytest.fixture
def drive(table):
    return OrientalAz(1, table)


@pytest.fixture
def host(drive):
    return Host(drive.session())


MOVE_FRAME = bytes.fromhex(
    "01 10 00 58 00 10 20 00000000 00000001 00002134 000007D0 000F4240 000F4240 000003E8 00000001 41 81"
)
SHEET_FRAMES = [
    (MOVE_FRAME, bytes.fromhex("01 10 00 58 00 10 40 16")),
    (bytes.fromhex("01 06 00 7D 00 10 18 1E"), bytes.fromhex("01 06 00 7D 00 10 18 1E")),
    (bytes.fromhex("01 06 00 7D 00 20 18 0A"), bytes.fromhex("01 06 00 7D 00 20 18 0A")),
    (bytes.fromhex("01 10 18 02 00 02 04 FF FF FC 18 99 58"), bytes.fromhex("01 10 18 02 00 02 E6 A8")),
]
FRAMES = [
    *SHEET_FRAMES,
    (framed("01 08 00 00 A5 37"), framed("01 08 00 00 A5 37")),
    (framed("01 17 18 02 00 02 18 02 00 02 04 00 00 12 34"), framed("01 17 04 00 00 12 34")),
    # exceptions: function, address (unknown, odd, half an item, read-only), value (range, count, byte count)
    (framed("01 04 00 CC 00 02"), framed("01 84 01")),
    (framed("01 0F 00 00 00 01 01 01"), framed("01 8F 01")),
    (framed("01 03 00 02 00 02"), framed("01 83 02")),
    (framed("01 03 00 CD 00 02"), framed("01 83 02")),
    (framed("01 03 00 CC 00 01"), framed("01 83 02")),
    (framed("01 10 00 7D 00 01 02 00 10"), framed("01 90 02")),
    (framed("01 10 00 CC 00 02 04 00 00 00 00"), framed("01 90 02")),
    (framed("01 06 00 CD 00 00"), framed("01 86 02")),
    (framed("01 03 00 CC 00 00"), framed("01 83 03")),
    (framed("01 03 00 CC 00 7E"), framed("01 83 03")),
    (framed("01 10 00 5A 00 02 04 00 00 00 04"), framed("01 90 03")),
    (framed("01 10 00 60 00 02 04 00 00 00 00"), framed("01 90 03")),
    (framed("01 10 00 5A 00 02 03 00 00 01"), framed("01 90 03")),
    (framed("01 08 00 01 00 00"), framed("01 88 03")),
    # a frame for another unit, and one for all
    (framed("02 03 00 CC 00 02"), b""),
    (framed("00 06 00 7D 00 00"), b""),
    # garbage before a frame
    (b"\xff\x00\x37" + framed("01 03 00 CC 00 02"), framed("01 03 04 00 00 00 00")),
    (framed("01 03 00 CC 00 02")[:-1] + b"\x00" + framed("01 03 00 CC 00 02"), framed("01 03 04 00 00 00 00")),
    (b"\x01\x10\x00\x58\x00\x10\x20" + framed("01 03 00 CC 00 02"), framed("01 03 04 00 00 00 00")),
    (framed("01 03 00 CC 00 02") * 2, framed("01 03 04 00 00 00 00") * 2),
]


@pytest.mark.parametrize(("request_", "reply"), FRAMES)
def test_frames_are_answered(drive, feed, request_, reply):
    replies = feed(drive.session(), request_, trailing=b"\x01\x03\x00")
    assert b"".join(text for _, text in replies) == reply


def test_the_frames_of_the_sheet_that_read(drive, ask):
    az = drive.session()
    ask(az, MOVE_FRAME)
    assert ask(az, bytes.fromhex("01 03 00 CC 00 02 04 34"), 60.0) == bytes.fromhex("01 03 04 00 00 21 34 E3 B4")
    assert ask(az, bytes.fromhex("01 03 00 7E 00 02 A4 13"), 60.0) == framed(f"01 03 04 00 00 {READY | IN_POS:04X}")


def test_a_function_nobody_knows_is_an_illegal_function(drive, ask):
    assert ask(drive.session(), framed("01 2B 0E 01 00")) == framed("01 AB 01")


def test_a_frame_with_a_wrong_checksum_is_not_answered_and_noted(drive, host):
    assert drive.session().receive(bytes.fromhex("01 03 00 CC 00 02 04 35"), 0.0) == []
    drive.session().receive(b"\x55" + framed("01 03 00 CC 00 02"), 0.0)
    assert host.read(0x00AC) == 0x84


def test_bytes_that_never_become_a_frame_fill_no_memory(drive, ask):
    az = drive.session()
    for _ in range(200):
        ask(az, b"\x01\x10\x00\x58" * 200)
    assert len(az._buffer) <= 256
    assert ask(az, framed("01 03 00 CC 00 02")) == framed("01 03 04 00 00 00 00")


def test_a_reply_takes_the_time_of_both_frames_and_a_millisecond(drive):
    character_s = 11 / 115_200
    first, second = drive.session().receive(framed("01 03 00 CC 00 02") * 2, 2.0)
    exchange_s = 0.001 + (8 + 3.5 + 9) * character_s
    assert_allclose([first[0], second[0]], [2.0 + exchange_s, 2.0 + 2 * exchange_s])


def test_a_broadcast_moves_without_an_answer(drive, host):
    body = b"\x00" + MOVE_FRAME[1:-2]
    assert drive.session().receive(body + crc16(body), 0.0) == []
    assert host.read(POSITION, 60.0) == 8500


def test_a_move_is_a_trapezoid_and_shows_in_the_status(host, table):
    assert host.has(READY | IN_POS | HOME_END, 0.0)
    host.move(1, 3000, 10.0)
    # 3000/2000 + 2000/10000 s
    assert host.has(MOVE, 11.69)
    assert not host.has(READY, 11.69)
    assert not host.has(IN_POS, 11.69)
    assert host.read(0x00D0, 11.0) == host.read(0x00CA, 11.0) == 2000
    assert host.read(0x00C8, 11.0) == 120
    assert host.has(READY | IN_POS, 11.7)
    assert not host.has(MOVE, 11.7)
    assert host.read(POSITION, 11.7) == host.read(0x00C6, 11.7) == 3000
    assert_allclose(table.position_deg(11.7), 60.0)


def test_starting_and_stopping_rates_differ(host):
    host.move(1, 3000, 0.0, rate=5_000, stop_rate=20_000)
    expected_s = 3000 / 2000 + 2000 / 2 * (1 / 5_000 + 1 / 20_000)
    assert host.has(MOVE, expected_s - 0.001)
    assert host.has(IN_POS, expected_s + 0.001)


@pytest.mark.parametrize(
    ("kind", "position", "end"),
    [
        (1, -500, -500),
        (2, -500, 500),
        (3, -500, 500),
        (8, 17_000, 17_000),
        (9, 17_000, -1000),
        (9, 2000, 2000),
        (10, 500, 18_500),
        (11, 2000, -16_000),
    ],
)
def test_operation_types(host, kind, position, end):
    host.move(1, 1000, 0.0)
    host.move(kind, position, 100.0)
    assert host.read(POSITION, 200.0) == end


def test_continuous_operation_runs_until_it_is_stopped(host):
    host.move(7, 0, 0.0, speed=-1000)
    assert host.read(0x00CA, 50.0) == -1000
    host.write(INPUT, STOP, now_s=50.0)
    assert host.has(IN_POS, 50.11)
    assert not host.has(READY, 50.11)
    host.write(INPUT, 0, now_s=51.0)
    assert host.has(READY, 51.0)


@pytest.mark.parametrize("bit", [STOP, FREE])
def test_a_move_is_not_taken_while_stop_or_free_is_on(host, bit):
    host.write(INPUT, bit)
    host.move(1, 500, 1.0)
    assert not host.has(MOVE, 1.1)
    assert host.read(0x00AC, 1.2) == 0x8D


def test_a_move_during_a_move_is_ignored_and_noted(host):
    host.move(1, 3000, 0.0)
    host.move(1, -3000, 0.5)
    assert host.read(POSITION, 60.0) == 3000
    assert host.read(0x00AC, 60.0) == 0x8D
    host.write(0x0188, 1, now_s=61.0)
    assert host.read(0x00AC, 61.0) == 0


def test_a_move_for_the_buffer_follows_the_one_under_way(host):
    host.move(1, 3000, 0.0)
    host.write(0x0068, 1, now_s=0.1)
    host.move(1, 1000, 0.2)
    assert host.read(POSITION, 1.7) == 3000
    assert host.read(POSITION, 60.0) == 1000


def test_inputs_are_levels_and_their_rise_starts(host):
    host.move(1, 1000, 0.0)
    host.write(INPUT, ZHOME, now_s=10.0)
    assert host.read(POSITION, 20.0) == 0
    assert host.has(HOME_END, 20.0)
    host.move(1, 1000, 21.0)
    host.write(INPUT, ZHOME, now_s=30.0)
    assert host.read(POSITION, 40.0) == 1000
    host.write(INPUT, 0, now_s=41.0)
    host.write(ONE_SHOT, ZHOME, now_s=42.0)
    assert host.read(POSITION, 50.0) == 0
    assert host.read(ONE_SHOT, 50.0) == 0


def test_a_single_register_sets_half_an_item(host, drive, ask):
    host.move(7, 0, 0.0)
    ask(drive.session(), bytes.fromhex("01 06 00 7D 00 20 18 0A"), 5.0)
    assert host.has(IN_POS, 5.3)
    ask(drive.session(), bytes.fromhex("01 06 00 7D 00 10 18 1E"), 6.0)
    assert host.read(POSITION, 20.0) == 0
    ask(drive.session(), framed("01 06 18 02 FF FF"))
    ask(drive.session(), framed("01 06 18 03 FC 18"))
    assert host.read(0x1802) == -1000


def test_stored_operations_start_by_their_number(host):
    host.write(0x1800 + 64 * 5, 1, 700, 2000, 10_000, 10_000, 1000)
    host.write(INPUT, 5 | START, now_s=1.0)
    assert host.has(5 | START | MOVE, 1.1)
    assert host.read(POSITION, 10.0) == 700
    host.write(0x1800, 1, 50, 2000, 10_000, 10_000, 1000, now_s=11.0)
    host.write(INPUT, 1 << 8, now_s=11.0)
    assert host.read(POSITION, 20.0) == 50


def test_jog_and_run_inputs(host):
    host.write(ONE_SHOT, FW_JOG)
    assert host.read(POSITION, 1.0) == 1
    host.write(INPUT, FW_POS, now_s=2.0)
    assert host.read(0x00CA, 3.0) == 1000
    host.write(INPUT, 0, now_s=4.0)
    assert host.has(IN_POS, 5.0)
    host.write(INPUT, RV_POS, now_s=6.0)
    assert host.read(0x00CA, 7.0) == -1000


def test_a_trigger_of_its_own_starts_when_only_that_item_is_written(host):
    host.write(DIRECT, 0, 1, 0, 2000, 10_000, 10_000, 1000, -3)
    host.write(DIRECT + 4, 400, now_s=1.0)
    assert host.read(POSITION, 10.0) == 400
    host.write(DIRECT + 6, 1500, now_s=11.0)
    assert host.has(IN_POS, 11.1)


def test_no_speed_is_an_alarm_until_it_is_reset(host):
    host.move(1, 100, 0.0, speed=0)
    assert host.read(0x0080) == 0x70
    assert host.has(ALARM, 0.0)
    host.move(1, 100, 1.0)
    assert not host.has(MOVE, 1.1)
    host.write(0x0180, 0, now_s=2.0)
    host.write(0x0180, 1, now_s=2.0)
    assert host.read(0x0080, 2.0) == 0
    host.move(1, 100, 3.0)
    assert host.has(MOVE, 3.01)
    host.move(1, 100, 4.0, speed=0)
    host.write(INPUT, ALM_RST, now_s=5.0)
    assert host.has(READY, 5.0)


def test_a_protection_stops_the_motor(host, drive):
    host.move(1, 3000, 0.0)
    drive.trip(0x30, 1.0)
    assert host.read(0x0080, 1.5) == 0x30
    assert host.has(ALARM | IN_POS, 1.5)
    # 2000 step/s · 1 s - 200 steps to start, and 200 to stop
    assert host.read(POSITION, 1.5) == 2000
    host.move(1, 0, 2.0)
    assert host.read(POSITION, 9.0) == 2000


def test_the_command_position_is_where_the_motor_was_told_to_be_and_the_feedback_where_it_is(host, table):
    table.position_deg = lambda time_s: table.motor_deg(time_s) + 0.1
    host.move(1, 3000, 0.0)
    assert (host.read(0x00C6, 1.0), host.read(POSITION, 1.0)) == (1800, 1805)
    assert (host.read(0x00C6, 10.0), host.read(POSITION, 10.0)) == (3000, 3005)
    # one is relative to the first, one to the second
    host.move(2, 100, 11.0)
    assert host.read(0x00C6, 20.0) == 3100
    host.move(3, 100, 21.0)
    assert host.read(0x00C6, 30.0) == 3205
    host.write(ONE_SHOT, ZHOME, now_s=31.0)
    assert host.has(HOME_END | IN_POS, 60.0)
    assert (host.read(0x00C6, 60.0), host.read(POSITION, 60.0)) == (0, 5)


def test_a_lost_home_is_an_alarm_again_and_again_until_a_position_is_preset(host, drive, table):
    host.move(1, 1000, 0.0)
    drive.lose_home(table, 10.0)
    assert host.read(0x0080, 10.0) == 0x4A
    host.write(INPUT, ALM_RST, now_s=11.0)
    host.write(INPUT, 0, now_s=11.0)
    assert host.has(READY, 11.0)
    for now_s, absolute in ((12.0, lambda now_s: host.move(1, 0, now_s)), (14.0, lambda now_s: host.move(9, 0, now_s))):
        absolute(now_s)
        assert host.read(0x0080, now_s) == 0x4A
        host.write(ONE_SHOT, ALM_RST, now_s=now_s + 0.5)
    host.write(ONE_SHOT, ZHOME, now_s=16.0)
    assert (host.read(0x0080, 16.0), host.read(POSITION, 20.0)) == (0x4A, 1000)
    host.write(ONE_SHOT, ALM_RST, now_s=21.0)
    # where nothing counts from home
    host.move(2, -100, 22.0)
    assert (host.read(0x0080, 23.0), host.read(POSITION, 30.0)) == (0, 900)
    host.write(0x018A, 1, now_s=31.0)
    assert host.has(HOME_END, 31.0)
    host.move(1, 200, 32.0)
    assert (host.read(0x0080, 40.0), host.read(POSITION, 40.0)) == (0, 200)


def test_a_one_shot_input_leaves_those_that_are_held(host):
    host.write(INPUT, STOP)
    host.write(ONE_SHOT, ALM_RST, now_s=1.0)
    assert not host.has(READY, 1.0)
    host.write(INPUT, 0, now_s=2.0)
    assert host.has(READY, 2.0)


def test_the_line_may_be_slow(table):
    ((due_s, _),) = OrientalAz(1, table, baudrate=9600).session().receive(framed("01 03 00 CC 00 02"), 2.0)
    assert_allclose(due_s, 2.0 + 0.001 + (8 + 3.5 + 9) * 11 / 9600)


def test_the_position_can_be_preset_at_rest_only(host, table):
    host.move(1, 1000, 0.0)
    assert host.write(0x018A, 1, now_s=0.1) == bytes.fromhex("01 90 04")
    host.write(0x018A, 1, now_s=10.0)
    assert host.read(POSITION, 10.0) == 0
    host.move(1, 500, 11.0)
    assert_allclose(table.position_deg(20.0), 30.0)


def test_a_write_that_is_refused_changes_nothing(host):
    host.write(DIRECT, 0, 1, 10, 2000, 10_000, 10_000, 1001, 1)
    assert host.read(DIRECT + 4) == 0
    assert host.read(0x00AC) == 0x8C


def test_temperatures_are_those_of_a_room_at_work(host):
    assert 200 < host.read(0x00FA) < host.read(0x00F8) < 600
    assert host.read(0x00D6) == 0
