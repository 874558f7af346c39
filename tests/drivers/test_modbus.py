from __future__ import annotations

import os
import socket
import struct
import sys

import numpy as np
import pytest

from drivers.modbus.frames import RtuFraming, TcpFraming, crc16
from drivers.modbus.port import ModbusPort
from drivers.modbus.unit import ModbusUnit, int32s, words_of
from goniometer.errors import DeviceFaultError, NotConnectedError, ReplyError, ReplyTimeoutError

# Frames of the two drives' fact sheets.
POSITION = bytes.fromhex("01 03 00 CC 00 02 04 34")
AT_8500 = bytes.fromhex("01 03 04 00 00 21 34 E3 B4")
STOP = bytes.fromhex("01 06 00 7D 00 20 18 0A")
MINUS_1000 = bytes.fromhex("01 10 18 02 00 02 04 FF FF FC 18 99 58")
MINUS_1000_TAKEN = bytes.fromhex("01 10 18 02 00 02 E6 A8")
LEC_POSITION = bytes.fromhex("01 03 90 00 00 02 E9 0B")
LEC_AT_150 = bytes.fromhex("01 03 04 00 00 3A 98 E9 39")
SERVO_ON = bytes.fromhex("01 05 00 19 FF 00 5D FD")
START = bytes.fromhex("01 10 91 00 00 01 02 01 00 27 09")

PUBLISHED = [POSITION, AT_8500, STOP, MINUS_1000, MINUS_1000_TAKEN, LEC_POSITION, LEC_AT_150, SERVO_ON, START]
ANSWERS = [AT_8500, STOP, MINUS_1000_TAKEN, LEC_AT_150, SERVO_ON]


def with_crc(frame: bytes) -> bytes:
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return frame + struct.pack("<H", crc)


def rtu(text: str) -> bytes:
    return with_crc(bytes.fromhex(text))


def read_one(address: int, unit: int = 1) -> bytes:
    return with_crc(struct.pack(">BBHH", unit, 3, address, 1))


def one_word(word: int, unit: int = 1) -> bytes:
    return with_crc(struct.pack(">BBBH", unit, 3, 2, word))


def loop_back(mark: int, unit: int = 1) -> bytes:
    return with_crc(struct.pack(">BBHH", unit, 8, 0, mark))


def split_rtu(received: bytes) -> tuple[bytes, bytes, bytes]:
    length = 9 + received[6] if received[1:2] == b"\x10" and len(received) > 6 else 8
    return (received[:length], b"!", received[length:]) if len(received) >= length else (b"", b"", received)


def split_tcp(received: bytes) -> tuple[bytes, bytes, bytes]:
    length = 6 + int.from_bytes(received[4:6], "big") if len(received) > 5 else 99
    return (received[:length], b"!", received[length:]) if len(received) >= length else (b"", b"", received)


@pytest.mark.parametrize("frame", PUBLISHED)
def test_checksum_of_published_frames(frame):
    assert crc16(frame[:-2]) == int.from_bytes(frame[-2:], "little")
    assert with_crc(frame[:-2]) == frame
    assert RtuFraming().wrap(frame[0], frame[1:-2]) == frame


@pytest.mark.parametrize("numbers", [[-1000], [0, -1], [2**31 - 1, -(2**31)]])
def test_numbers_of_two_registers_have_the_high_word_first(numbers):
    assert int32s(words_of(numbers)) == numbers
    assert words_of([-1000]) == [0xFFFF, 0xFC18]


class TestRtuFrames:
    @pytest.mark.parametrize("frame", [*ANSWERS, rtu("01 83 02"), rtu("01 01 01 05"), loop_back(7)])
    @pytest.mark.parametrize("before", [b"", b"\x00", b"\x01", b"\x01\x03", b"\x01\x03\xff\x01", b"\xff" * 40])
    @pytest.mark.parametrize("after", [b"", b"\x01", AT_8500])
    def test_fed_whole_after_noise_and_with_trailing_bytes(self, frame, before, after):
        received = bytearray(before + frame + after)
        assert RtuFraming().take(received, 1) == frame[1:-2]
        assert received == after

    @pytest.mark.parametrize("frame", ANSWERS)
    def test_fed_byte_by_byte(self, frame):
        received = bytearray()
        for byte in frame[:-1]:
            received.append(byte)
            assert RtuFraming().take(received, 1) is None
        received.append(frame[-1])
        assert RtuFraming().take(received, 1) == frame[1:-2]
        assert not received

    def test_frames_of_other_units_are_skipped(self):
        received = bytearray(one_word(7, unit=2) + one_word(8, unit=1))
        assert RtuFraming().take(received, 1) == one_word(8)[1:-2]

    def test_no_mutated_frame_is_taken_for_one(self):
        random = np.random.default_rng(1)
        for _ in range(30_000):
            frame = np.frombuffer(ANSWERS[random.integers(len(ANSWERS))], np.uint8)
            mutated = frame.copy()
            mutated[random.integers(len(frame), size=random.integers(1, 4))] ^= random.integers(1, 256, dtype=np.uint8)
            received = bytearray(mutated[: random.integers(1, len(frame) + 1)].tobytes())
            if received != frame.tobytes():
                assert RtuFraming().take(received, 1) is None

    def test_memory_is_bounded_whatever_comes(self):
        random = np.random.default_rng(2)
        received = bytearray()
        for _ in range(10_000):
            received += random.choice(np.array([0, 1, 3, 16, 255], np.uint8), random.integers(1, 9)).tobytes()
            RtuFraming().take(received, 1)
            assert len(received) <= 5 + 255


class TestTcpFrames:
    def test_published_layout(self):
        assert TcpFraming().wrap(1, POSITION[1:-2]) == bytes.fromhex("0001 0000 0006 01 03 00CC 0002")

    @pytest.mark.parametrize(
        "before", [b"", bytes.fromhex("0000 0000 0005 01 03 02 0007"), b"\xff", b"\x00\x01\x00\x05"]
    )
    @pytest.mark.parametrize("after", [b"", b"\x00\x01"])
    def test_only_the_answer_to_the_last_request_is_taken(self, before, after):
        framing = TcpFraming()
        framing.wrap(1, b"?")
        answer = bytes.fromhex("0001 0000 0007 01 03 04 00002134")
        received = bytearray(before)
        for byte in answer[:-1]:
            received.append(byte)
            assert framing.take(received, 1) is None
        received += answer[-1:] + after
        assert framing.take(received, 1) == AT_8500[1:-2]
        assert received == after

    def test_memory_is_bounded_whatever_comes(self):
        random, framing, received = np.random.default_rng(3), TcpFraming(), bytearray()
        framing.wrap(1, b"?")
        for _ in range(20_000):
            received += random.choice(np.array([0, 1, 5, 255], np.uint8), random.integers(1, 9)).tobytes()
            framing.take(received, 1)
            assert len(received) <= 6 + 255


@pytest.fixture
def port_of(clock):
    ports = []

    def make(address, reply_timeout_s=2.0, **parameters):
        ports.append(ModbusPort(address, device="line", reply_timeout_s=reply_timeout_s, **parameters))
        return ports[-1]

    yield make
    for port in ports:
        port.close()


@pytest.fixture
def unit(make_peer, port_of):
    def make(answers, reply_timeout_s=2.0):
        peer = make_peer(answers, split=split_rtu)
        return peer, ModbusUnit(port_of(peer.port, reply_timeout_s), 1, device="stage")

    return make


class TestUnit:
    def test_every_kind_of_request(self, unit):
        peer, unit = unit(
            {
                rtu("01 01 0018 0003"): rtu("01 01 01 05"),
                rtu("01 02 0040 0010"): rtu("01 02 02 01 86"),
                LEC_POSITION: LEC_AT_150,
                SERVO_ON: SERVO_ON,
                rtu("01 05 0019 0000"): rtu("01 05 0019 0000"),
                STOP: STOP,
                MINUS_1000: MINUS_1000_TAKEN,
                START: rtu("01 10 9100 0001"),
            }
        )
        assert unit.read_coils(0x18, 3) == [True, False, True]
        inputs = unit.read_inputs(0x40, 16)
        assert [number for number, on in enumerate(inputs) if on] == [0, 9, 10, 15]
        assert unit.read_int32(0x9000) == [15000]
        unit.write_coil(0x19, on=True)
        unit.write_coil(0x19, on=False)
        unit.write_register(0x7D, 0x20)
        unit.write_int32(0x1802, [-1000])
        unit.write_registers(0x9100, [0x0100])
        assert len(peer.commands) == 8

    def test_answer_in_pieces_behind_noise(self, unit, monkeypatch):
        peer, unit = unit({POSITION: b"\xff\x01\x03" + AT_8500})
        receive, came = unit.open()._port.receive, bytearray()

        def one_byte_at_a_time(wait_s):
            came.extend(receive(0.0 if came else wait_s))
            byte = bytes(came[:1])
            del came[:1]
            return byte

        monkeypatch.setattr(unit.open()._port, "receive", one_byte_at_a_time)
        assert unit.read_int32(0xCC) == [8500]
        assert peer.commands == [POSITION]

    def test_lost_read_is_repeated_and_its_late_answer_dropped(self, unit):
        late = one_word(1)
        peer, unit = unit({read_one(5): [b"", one_word(2)], loop_back(1): late + loop_back(1)}, reply_timeout_s=0.05)
        assert unit.read_registers(5, 1) == [2]
        assert peer.commands == [read_one(5), loop_back(1), read_one(5)]

    def test_garbled_read_is_repeated(self, unit):
        garbled = AT_8500[:-1] + b"\x00"
        _, unit = unit({POSITION: [garbled, AT_8500], loop_back(1): loop_back(1)}, reply_timeout_s=0.05)
        assert unit.read_int32(0xCC) == [8500]

    def test_unit_that_knows_no_loop_back_is_asked_again_too(self, unit):
        _, unit = unit({POSITION: [b"", AT_8500], loop_back(1): rtu("01 88 01")}, reply_timeout_s=0.05)
        assert unit.read_int32(0xCC) == [8500]

    def test_duplicated_answer_is_not_taken_for_the_next_one(self, unit, until):
        peer, unit = unit({read_one(5): [2 * one_word(1), one_word(2)], loop_back(1): loop_back(1)})
        assert unit.read_registers(5, 1) == [1]
        assert unit.read_registers(5, 1) == [2]
        assert peer.commands == [read_one(5), loop_back(1), read_one(5)]

    def test_every_proof_has_a_number_of_its_own(self, unit):
        answers = {read_one(5): [b"", one_word(1), b"", one_word(2)]}
        answers |= {loop_back(mark): loop_back(mark) for mark in (1, 2)}
        peer, unit = unit(answers, reply_timeout_s=0.05)
        assert [unit.read_registers(5, 1), unit.read_registers(5, 1)] == [[1], [2]]
        assert [command for command in peer.commands if command[1] == 8] == [loop_back(1), loop_back(2)]

    def test_three_lost_answers_are_a_timeout(self, unit):
        peer, unit = unit({}, reply_timeout_s=0.02)
        with pytest.raises(ReplyTimeoutError, match=r"stage: no valid answer to the loop-back of unit 1 on port"):
            unit.read_registers(5, 1)
        assert peer.commands == [read_one(5), loop_back(1), loop_back(2)]

    def test_lost_write_is_never_repeated(self, unit):
        peer, unit = unit({}, reply_timeout_s=0.02)
        for write in (
            lambda: unit.write_coil(0x19, on=True),
            lambda: unit.write_register(0x7D, 0x20),
            lambda: unit.write_int32(0x1802, [-1000]),
        ):
            with pytest.raises(ReplyTimeoutError, match="the drive may still carry out its last command"):
                write()
        assert peer.commands == [SERVO_ON, STOP, MINUS_1000]

    def test_write_goes_out_at_once_after_a_lost_answer_and_finds_its_own(self, unit):
        peer, unit = unit({POSITION: b"", STOP: AT_8500 + rtu("01 83 04") + STOP}, reply_timeout_s=0.02)
        with pytest.raises(ReplyTimeoutError, match="no valid answer"):
            unit.read_int32(0xCC)
        sent = len(peer.commands)
        unit.write_register(0x7D, 0x20)
        assert peer.commands[sent:] == [STOP]

    @pytest.mark.parametrize("echo", ["01 06 00 7D 00 00", "01 06 00 7C 00 20", "01 05 00 7D 00 20"])
    def test_write_that_is_not_echoed_is_refused(self, unit, echo):
        _, unit = unit({STOP: rtu(echo)})
        with pytest.raises(ReplyError, match=r"'write to 0x007D' is '0. 00 7. .*not 5 bytes that begin with 06 00 7d"):
            unit.write_register(0x7D, 0x20)

    @pytest.mark.parametrize(
        ("code", "text"), [(1, "illegal function"), (2, "illegal address"), (3, "illegal value"), (9, "unknown")]
    )
    def test_refusal_is_a_fault_and_is_not_repeated(self, unit, code, text):
        peer, unit = unit({POSITION: rtu(f"01 83 {code:02X}")})
        with pytest.raises(DeviceFaultError, match=f"refused the read of 0x00CC with exception {code}, {text}"):
            unit.read_int32(0xCC)
        assert peer.commands == [POSITION]

    def test_endless_output_is_no_answer(self, unit):
        _, unit = unit({POSITION: b"\x01\x55" * 100_000}, reply_timeout_s=0.05)
        with pytest.raises((ReplyTimeoutError, ReplyError), match="stage: "):
            unit.read_int32(0xCC)

    def test_port_that_was_opened_afresh_is_not_trusted(self, unit):
        peer, unit = unit({POSITION: AT_8500, loop_back(1): AT_8500 + loop_back(1)})
        unit.open()
        unit.reopen()
        assert unit.read_int32(0xCC) == [8500]
        assert peer.commands == [loop_back(1), POSITION]

    def test_units_share_a_port_and_are_named_apart(self, make_peer, port_of):
        answers = {read_one(5, unit): one_word(10 * unit, unit) for unit in (1, 2)}
        peer = make_peer(answers, split=split_rtu)
        port = port_of(peer.port, 0.02)
        units = [ModbusUnit(port, number, device=f"stage {number}") for number in (1, 2, 3)]
        assert [unit.read_registers(5, 1) for unit in units[:2]] == [[10], [20]]
        with pytest.raises(ReplyTimeoutError, match=r"stage 3: no valid answer .* of unit 3"):
            units[2].write_coil(0x19, on=True)
        assert units[0].read_registers(5, 1) == [10]
        assert peer.connections == 1

    def test_closed_port_is_not_connected(self, unit):
        _, unit = unit({})
        unit.open()
        unit.close()
        unit.close()
        with pytest.raises(NotConnectedError, match=r"stage: the link on port .* is gone"):
            unit.read_registers(5, 1)


class TestModbusTcp:
    @pytest.fixture
    def unit(self, make_peer, port_of):
        def make(answers, reply_timeout_s=2.0):
            peer = make_peer(answers, split=split_tcp)
            port = port_of(peer.port.replace("socket", "modbus-tcp"), reply_timeout_s)
            return peer, ModbusUnit(port, 1, device="stage")

        return make

    @staticmethod
    def ask(transaction: int) -> bytes:
        return struct.pack(">HHHBBHH", transaction, 0, 6, 1, 3, 5, 1)

    @staticmethod
    def answer(transaction: int, word: int, unit: int = 1) -> bytes:
        return struct.pack(">HHHBBBH", transaction, 0, 5, unit, 3, 2, word)

    def test_reads(self, unit):
        _, unit = unit({self.ask(1): self.answer(1, 7), self.ask(2): self.answer(2, 8)})
        assert [unit.read_registers(5, 1), unit.read_registers(5, 1)] == [[7], [8]]

    def test_late_and_duplicated_answers_are_dropped_by_their_numbers(self, unit):
        peer, unit = unit(
            {self.ask(2): self.answer(1, 6) + self.answer(2, 7) + self.answer(2, 7), self.ask(3): self.answer(3, 8)},
            reply_timeout_s=0.05,
        )
        assert [unit.read_registers(5, 1), unit.read_registers(5, 1)] == [[7], [8]]
        assert peer.commands == [self.ask(1), self.ask(2), self.ask(3)]

    def test_answer_of_another_unit_is_none(self, unit):
        _, unit = unit({self.ask(1): self.answer(1, 6, unit=2)}, reply_timeout_s=0.02)
        with pytest.raises(
            ReplyTimeoutError, match="no valid answer to the read of 0x0005 of unit 1 on port modbus-tcp:"
        ):
            unit.read_registers(5, 1)

    def test_refusal(self, unit):
        _, unit = unit({self.ask(1): bytes.fromhex("0001 0000 0003 01 83 02")})
        with pytest.raises(DeviceFaultError, match="exception 2, illegal address"):
            unit.read_registers(5, 1)


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")
def test_serial_line_is_silent_for_three_and_a_half_characters_between_frames(port_of):
    import threading
    import tty

    controller, terminal = os.openpty()
    tty.setraw(terminal)
    unit = ModbusUnit(port_of(os.ttyname(terminal), baudrate=9600), 1, device="stage")
    waits = []
    link = unit.open()
    link._port.receive, receive = lambda wait_s: (waits.append(wait_s), receive(wait_s))[1], link._port.receive

    def answer():
        for word in (1, 2):
            assert os.read(controller, 8) == read_one(5)
            os.write(controller, one_word(word))

    peer = threading.Thread(target=answer, daemon=True)
    peer.start()
    assert [unit.read_registers(5, 1), unit.read_registers(5, 1)] == [[1], [2]]
    peer.join(5)
    pauses = [wait_s for wait_s in waits if 0 < wait_s < 1]
    assert len(pauses) == 1
    assert 0.5 * 3.5 * 11 / 9600 < pauses[0] <= 3.5 * 11 / 9600
    os.close(controller)
    os.close(terminal)


@pytest.mark.parametrize(
    "address", ["socket://nowhere", "socket://nowhere:x", "modbus-tcp://127.0.0.1", "/dev/no_such_port"]
)
def test_unusable_address_is_not_connected(address, port_of):
    with pytest.raises(NotConnectedError, match=f"line: port {address} cannot be opened"):
        ModbusUnit(port_of(address), 1, device="stage").open()


def test_nobody_at_the_address_is_not_connected(port_of):
    with socket.create_server(("127.0.0.1", 0)) as server:
        free = server.getsockname()[1]
    with pytest.raises(NotConnectedError, match=f"line: port modbus-tcp://127.0.0.1:{free} cannot be opened"):
        ModbusUnit(port_of(f"modbus-tcp://127.0.0.1:{free}"), 1, device="stage").open()
