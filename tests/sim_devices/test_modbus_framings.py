"""One unit answers alike behind RTU and TCP frames, passes others' traffic over, and survives any bytes."""

import random
import struct

import pytest
from numpy.testing import assert_allclose

from sim_devices.axis import Axis
from sim_devices.modbus.rtu import RtuSession, crc16
from sim_devices.modbus.tcp import ModbusTcp
from sim_devices.oriental_az.drive import OrientalAz
from sim_devices.smc_lec.controller import SmcLec


def rtu(text, unit=1):
    body = bytes([unit]) + bytes.fromhex(text)
    return body + crc16(body)


def tcp(text, unit=1, transaction=0x1234):
    request = bytes.fromhex(text)
    return struct.pack(">HHHB", transaction, 0, len(request) + 1, unit) + request


def az(unit=1):
    return OrientalAz(unit, Axis(0.02))


def lec(unit=1):
    return SmcLec(unit, Axis(0.01))


def body_of(replies):
    return b"".join(text for _, text in replies)


EXCHANGES = [
    (az, "03 00 CC 00 02", "03 04 00 00 00 00"),
    (az, "06 00 7D 00 10", "06 00 7D 00 10"),
    (az, "08 00 00 A5 37", "08 00 00 A5 37"),
    (az, "10 18 02 00 02 04 FF FF FC 18", "10 18 02 00 02"),
    (az, "17 18 02 00 02 18 02 00 02 04 00 00 12 34", "17 04 00 00 12 34"),
    (az, "01 00 00 00 01", "81 01"),
    (az, "02 00 00 00 01", "82 01"),
    (az, "05 00 00 FF 00", "85 01"),
    (az, "0F 00 00 00 01 01 01", "8F 01"),
    (az, "2B 0E 01 00", "AB 01"),
    (lec, "01 00 10 00 09", "01 02 00 00"),
    (lec, "02 00 40 00 10", "02 02 00 00"),
    (lec, "03 90 00 00 02", "03 04 00 00 00 00"),
    (lec, "05 00 30 FF 00", "05 00 30 FF 00"),
    (lec, "08 00 00 A5 37", "08 00 00 A5 37"),
    (lec, "0F 00 30 00 01 01 01", "0F 00 30 00 01"),
    (lec, "10 91 02 00 01 02 00 01", "10 91 02 00 01"),
    (lec, "06 91 02 00 01", "86 01"),
    (lec, "17 90 00 00 02 91 02 00 01 02 00 01", "97 01"),
]


@pytest.mark.parametrize(("device", "request_", "answer"), EXCHANGES)
def test_a_unit_answers_alike_in_both_framings(device, request_, answer):
    assert body_of(device().session().receive(rtu(request_), 0.0)) == rtu(answer)
    assert body_of(ModbusTcp([device()]).session().receive(tcp(request_), 0.0)) == tcp(answer)


@pytest.mark.parametrize(
    ("sent", "reply"),
    [
        (tcp("03 90 00 00 02", transaction=1), tcp("03 04 00 00 00 00", transaction=1)),
        (
            tcp("03 90 00 00 02", transaction=0xFFFF) + tcp("08 00 00 01 02 03 04", transaction=0),
            tcp("03 04 00 00 00 00", transaction=0xFFFF) + tcp("08 00 00 01 02 03 04", transaction=0),
        ),
        (tcp("03 90 00 00 02", unit=9), tcp("83 0B", unit=9)),
        (tcp("05 00 30 FF 00", unit=0), b""),
        # requests that only a frame without a checksum can bring: too short, too long, counts that do not agree
        (tcp("03"), tcp("83 03")),
        (tcp("03 90 00 00"), tcp("83 03")),
        (tcp("03 90 00 00 02 00"), tcp("83 03")),
        (tcp("05 00 30"), tcp("85 03")),
        (tcp("08"), tcp("88 03")),
        (tcp("10 91 02 00 02 04 00 01"), tcp("90 03")),
        (tcp("0F 00 30 00 01 01"), tcp("8F 03")),
    ],
)
def test_tcp_frames(feed, sent, reply):
    assert body_of(feed(ModbusTcp([lec()]).session(), sent, trailing=b"\0\1\0\0\0")) == reply


@pytest.mark.parametrize(
    "garbage", ["00 01 00 02 00 06 01", "00 01 00 00 00 01 01", "00 01 00 00 01 00 01", "FF" * 300]
)
def test_what_is_no_tcp_frame_is_dropped_with_all_behind_it(garbage):
    session = ModbusTcp([lec()]).session()
    assert session.receive(bytes.fromhex(garbage) + tcp("03 90 00 00 02"), 0.0) == []
    assert body_of(session.receive(tcp("03 90 00 00 02"), 1.0)) == tcp("03 04 00 00 00 00")


def test_two_clients_of_a_gateway_share_its_line():
    gateway = ModbusTcp([az(1), lec(2)])
    ((first_s, _),) = gateway.session().receive(tcp("03 00 CC 00 02", unit=1), 5.0)
    ((second_s, _),) = gateway.session().receive(tcp("03 90 00 00 02", unit=2), 5.0)
    characters = 8 + 3.5 + 9
    assert_allclose(first_s, 5.001 + characters * 11 / 115_200)
    assert_allclose(second_s - first_s, 0.004 + characters * 10 / 38_400)


def test_both_framings_reach_the_same_state():
    controller = lec()
    controller.session().receive(rtu("05 00 30 FF 00"), 0.0)
    assert body_of(ModbusTcp([controller]).session().receive(tcp("01 00 30 00 01"), 0.0)) == tcp("01 01 01")


def test_a_broadcast_reaches_every_unit_behind_a_gateway():
    units = [lec(1), lec(2)]
    assert ModbusTcp(units).session().receive(tcp("05 00 30 FF 00", unit=0), 0.0) == []
    for unit in units:
        assert unit.answer(bytes.fromhex("01 00 30 00 01"), 0.0) == bytes.fromhex("01 01 01")


# what a unit hears on a line with others: their requests and their replies
TRAFFIC = [
    ("03 90 00 00 02", "03 04 00 00 3A 98"),
    ("03 90 00 00 10", "03 20" + "5A" * 32),
    ("01 00 10 00 09", "01 02 00 00"),
    ("02 00 40 00 10", "02 02 07 00"),
    ("05 00 19 FF 00", "05 00 19 FF 00"),
    ("06 00 7D 00 10", "06 00 7D 00 10"),
    ("08 00 00 A5 37", "08 00 00 A5 37"),
    ("0F 00 10 00 09 02 FF 01", "0F 00 10 00 09"),
    ("10 91 00 00 01 02 01 00", "10 91 00 00 01"),
    ("17 18 02 00 02 18 02 00 02 04 00 00 12 34", "17 04 00 00 12 34"),
    ("03 00 00 00 02", "83 02"),
    ("17 18 02 00 02 18 02 00 02 04 00 00 12 34", "97 01"),
]


@pytest.mark.parametrize(("request_", "answer"), TRAFFIC)
def test_others_on_the_line_are_passed_over(feed, request_, answer):
    drive = az(1)
    heard = rtu(request_, unit=2) + rtu(answer, unit=2) + rtu(request_, unit=3) + rtu("03 00 AC 00 02")
    # the drive's record of communication errors stays empty
    assert body_of(feed(drive.session(), heard, trailing=b"\x02\x03")) == rtu("03 04 00 00 00 00")


def test_a_unit_whose_neighbour_is_garbled_hears_what_is_for_it():
    drive = az(1)
    garbled = bytearray(rtu("03 04 00 00 3A 98", unit=2))
    garbled[4] ^= 0x10
    assert body_of(drive.session().receive(bytes(garbled) + rtu("03 00 CC 00 02"), 0.0)) == rtu("03 04 00 00 00 00")


class Recorder:
    """A unit that only keeps what it is asked."""

    unit, latency_s, character_s = 1, 0.0, 0.0

    def __init__(self):
        self.requests = []

    def answer(self, request, now_s):
        self.requests.append(request)
        return request

    def note_bad_frame(self):
        pass


def test_no_frame_with_wrong_bits_is_obeyed():
    random_ = random.Random(5)
    frames = [rtu(request, unit) for unit in (0, 1, 2) for _, request, _ in EXCHANGES]
    recorder = Recorder()
    for _ in range(30_000):
        frame = bytearray(random_.choice(frames))
        for bit in random_.sample(range(8 * len(frame)), random_.randint(1, 3)):
            frame[bit // 8] ^= 1 << bit % 8
        RtuSession(recorder).receive(bytes(frame), 0.0)
    assert recorder.requests == []
    RtuSession(recorder).receive(frames[0], 0.0)
    assert recorder.requests == [frames[0][1:-2]]


@pytest.mark.parametrize("device", [az, lec])
@pytest.mark.parametrize("framed", [rtu, tcp])
def test_any_bytes_leave_a_session_bounded_and_answering(device, framed):
    random_ = random.Random(6)
    unit = device()
    session = unit.session() if framed is rtu else ModbusTcp([unit]).session()
    frames = [framed(request) for kind, request, _ in EXCHANGES if kind is device]
    for _ in range(10_000):
        noise = bytearray(random_.choice(frames))
        for _ in range(random_.randint(1, 4)):
            place = random_.randrange(len(noise))
            noise[place : place + random_.randint(0, 2)] = random_.randbytes(random_.randint(0, 3))
            noise = noise or bytearray(1)
        session.receive(bytes(noise), 0.0)
        assert len(session._buffer) <= 260
    # what lies unfinished is at most one frame long
    session.receive(framed("08 00 00 A5 37") * 40, 0.0)
    assert body_of(session.receive(framed("08 00 00 A5 37") * 40, 1.0)).endswith(framed("08 00 00 A5 37"))


def test_a_flood_costs_little():
    session = az().session()
    session.receive(b"\x01\x10\x00\x58\x00\x10\xf0" * 10_000, 0.0)
    assert len(session._buffer) <= 256


def test_a_long_silence_ends_a_frame():
    motor = Axis(0.02)
    session = OrientalAz(1, motor).session()
    move = rtu("10 18 02 00 02 04 00 00 03 E8")
    assert session.receive(move[:6], 0.0) == []
    assert session.receive(move[6:], 5.0) == []
    assert body_of(session.receive(move, 10.0)) == rtu("10 18 02 00 02")


def test_a_frame_that_comes_in_pieces_within_a_computers_delays_counts():
    session = OrientalAz(1, Axis(0.02)).session()
    move = rtu("10 18 02 00 02 04 00 00 03 E8")
    assert session.receive(move[:6], 0.0) == []
    assert body_of(session.receive(move[6:], 0.1)) == rtu("10 18 02 00 02")
