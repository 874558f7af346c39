"""What faults make of a device's replies, and that replies keep their order however late they are."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim_devices.faults.faulty_port import FaultyPort, FaultySession
from sim_devices.faults.known import one_fault
from sim_devices.modbus.rtu import crc16

REPLY = b"12.500000\r\n"


class Echo:
    """Answers each message after 10 ms with itself."""

    def receive(self, data, now_s):
        return [(now_s + 0.01, data)]


class Announcer:
    """Says what it was sent on its own, 3 s later."""

    def receive(self, data, now_s):
        return [(now_s + 3.0, lambda due_s: [(due_s, data)])]


def fault(name, **keys):
    return one_fault.validate_python({"fault": name, "device": "meter", **keys})


def random():
    return np.random.default_rng(5)


def become(name, reply=REPLY, **keys):
    return fault(name, **keys).disturbed(1.0, reply, random())


@pytest.fixture(params=[False, True], ids=["real time", "virtual time"])
def port(request):
    return FaultyPort(is_virtual=request.param)


@pytest.fixture
def scaled_port():
    return FaultyPort(is_virtual=False)


@pytest.fixture
def virtual_port():
    return FaultyPort(is_virtual=True)


def faulty(port, name, device=None, **keys):
    """A session at a port with one such fault."""
    chosen = fault(name, **keys)
    port.disturb(chosen.disturbed, random(), chosen.replies)
    return FaultySession(device or Echo(), port)


def replies(due):
    return [entry for entry in due if isinstance(entry[1], bytes)]


def heard(due):
    """All that comes in the end, in the order of its times."""
    text, waiting = b"", sorted(due, key=lambda entry: entry[0])
    while waiting:
        due_s, said = waiting.pop(0)
        if isinstance(said, bytes):
            text += said
        else:
            waiting = sorted([*said(due_s), *waiting], key=lambda entry: entry[0])
    return text


def test_a_late_reply_comes_later():
    assert become("late", late_s=2.5) == [(3.5, REPLY)]


def test_a_slow_drip_is_one_byte_a_second():
    chunks = become("slow_drip")
    assert_allclose([due_s for due_s, _ in chunks], 2.0 + np.arange(len(REPLY)))
    assert [chunk for _, chunk in chunks] == [bytes([byte]) for byte in REPLY]


def test_a_missing_reply_does_not_come():
    assert become("missing") == []


@pytest.mark.parametrize("lost_bytes", [1, 2, 11, 400])
def test_a_short_reply_lacks_its_end(lost_bytes):
    assert become("short", lost_bytes=lost_bytes) == [(1.0, REPLY[: max(0, 11 - lost_bytes)])]


def test_a_split_reply_is_whole_in_the_end():
    (first_s, first), (second_s, second) = become("split", apart_s=0.2)
    assert first + second == REPLY
    assert_allclose((first_s, second_s), (1.0, 1.2))


def test_a_duplicated_reply_comes_twice():
    assert become("duplicated") == [(1.0, REPLY), (1.0, REPLY)]


@pytest.mark.parametrize("bits", [1, 2, 8, 1000])
def test_a_garbled_reply_has_so_many_wrong_bits(bits):
    ((due_s, garbled),) = become("garbled", bits=bits)
    wrong = sum((one ^ other).bit_count() for one, other in zip(garbled, REPLY, strict=True))
    assert (due_s, wrong) == (1.0, min(bits, 8 * len(REPLY)))


def test_a_crc_error_is_one_in_the_checksum_alone():
    body = bytes.fromhex("01 03 04 00 00 21 34")
    ((_, reply),) = become("crc_error", body + crc16(body))
    assert reply[:-2] == body
    assert reply[-2:] != crc16(body)


def test_a_modbus_exception_is_a_good_frame():
    body = bytes.fromhex("01 03 04 00 00 21 34")
    ((_, reply),) = become("modbus_exception", body + crc16(body), code=6)
    assert reply == bytes.fromhex("01 83 06") + crc16(bytes.fromhex("01 83 06"))


def test_a_modbus_exception_behind_a_gateway_keeps_the_transaction():
    ((_, reply),) = become("modbus_exception", bytes.fromhex("12 34 00 00 00 07 01 03 04 00 00 21 34"), code=2)
    assert reply == bytes.fromhex("12 34 00 00 00 03 01 83 02")


def test_only_so_many_replies_are_disturbed(port):
    session = faulty(port, "missing", replies=2)
    assert [heard(session.receive(b"%d" % number, number)) for number in range(4)] == [b"", b"", b"2", b"3"]


def test_faults_add_up(port):
    session = faulty(port, "duplicated")
    port.disturb(fault("short", lost_bytes=2).disturbed, random(), 1)
    assert heard(session.receive(b"abcd", 0.0)) == b"abab"


def test_merged_replies_come_with_the_second(port):
    session = faulty(port, "merged")
    assert session.receive(b"one ", 0.0) == []
    assert session.receive(b"two ", 1.0) == [(1.01, b"one two ")]
    assert session.receive(b"three", 2.0) == [(2.01, b"three")]


@pytest.mark.parametrize(("late_s", "is_waited_for"), [(0.4, True), (0.6, False)])
def test_virtual_time_waits_for_what_a_client_would_wait_for(port, late_s, is_waited_for):
    due = faulty(port, "late", late_s=late_s).receive(b"a", 0.0)
    assert len(replies(due)) == is_waited_for
    assert heard(due) == b"a"
    assert_allclose(due[0][0], 0.01 + late_s)


def test_no_reply_overtakes_a_late_one(scaled_port):
    session = faulty(scaled_port, "late", late_s=2.0)
    due = [*session.receive(b"first ", 0.0), *session.receive(b"second ", 1.0)]
    assert_allclose([due_s for due_s, _ in due], 2.01)
    assert heard(due) == b"first second "
    assert session.receive(b"third", 5.0) == [(5.01, b"third")]


def test_no_reply_overtakes_one_that_is_a_little_late(port):
    session = faulty(port, "late", late_s=0.3)
    due = [*session.receive(b"first ", 0.0), *session.receive(b"second", 0.1)]
    assert heard(due) == b"first second"


def test_a_client_that_speaks_again_in_virtual_time_has_waited_a_second(virtual_port):
    session = faulty(virtual_port, "late", late_s=1.5)
    assert replies(session.receive(b"first ", 0.0)) == []
    assert replies(session.receive(b"second ", 0.0)) == []
    assert heard(replies(session.receive(b"third", 0.0))) == b"first second third"


def test_what_a_device_says_on_its_own_is_disturbed_too(port):
    ((due_s, announced),) = faulty(port, "short", Announcer()).receive(b"done", 0.0)
    assert announced(due_s) == [(3.0, b"don")]


def test_a_deaf_device_hears_and_says_nothing(port):
    session = FaultySession(Announcer(), port)
    ((due_s, announced),) = session.receive(b"before", 0.0)
    port.deaf_until_s = 4.0
    assert session.receive(b"meanwhile", 1.0) == []
    assert announced(due_s) == []
    ((due_s, announced),) = session.receive(b"after", 4.0)
    assert announced(due_s) == [(7.0, b"after")]


def test_a_busy_device_hears_later_and_once(scaled_port):
    session = FaultySession(Echo(), scaled_port)
    scaled_port.busy_until_s = 2.0
    due = [*session.receive(b"one ", 0.0), *session.receive(b"two ", 1.0)]
    assert [due_s for due_s, _ in due] == [2.0, 2.0]
    assert heard(due) == b"one two "
    assert session.receive(b"three", 2.5) == [(2.51, b"three")]


def test_the_same_seed_gives_the_same_garbage():
    assert become("garbled", bits=4) == become("garbled", bits=4)


ANSWER = b"\1\3\4\0\0\x40\x30"
FRAMES = [ANSWER + crc16(ANSWER), b"\0\7\0\0\0\7" + ANSWER, b"\0\0\0\0\0\1\1\3", bytes(20)]


@pytest.mark.parametrize("name", ["modbus_exception", "crc_error", "garbled", "split", "merged", "short", "duplicated"])
@pytest.mark.parametrize("frame", FRAMES)
def test_what_another_fault_has_left_of_a_frame_stops_no_bench(name, frame):
    for length in range(1, len(frame) + 1):
        assert all(isinstance(piece, bytes) for _, piece in become(name, frame[:length]))


def test_less_than_a_frame_is_no_reply_to_refuse():
    assert become("modbus_exception", b"\1") == [(1.0, b"\1")]
    assert become("modbus_exception", b"\1\3\4\0") == [(1.0, b"\1\3\4\0")]
