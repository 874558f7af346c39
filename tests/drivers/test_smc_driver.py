from __future__ import annotations

import struct

import pytest

from drivers.modbus.port import ModbusPort
from drivers.modbus.unit import ModbusUnit, int32s, words_of
from drivers.smc_lec.registers import LecRegisters
from drivers.smc_lec.stage import SmcLec
from goniometer.errors import ConfigurationError, DeviceFaultError, NotConnectedError, ReplyTimeoutError

HOLD, SERVO, RESET, SET_UP, SERIAL = 0x18, 0x19, 0x1B, 0x1C, 0x30
BUSY, READY, HOMED, IN_POSITION, EMERGENCY_STOP, ALARM = 0x48, 0x49, 0x4A, 0x4B, 0x4E, 0x4F
START, OPERATION, PRESENT = 0x9100, 0x9102, 0x9000


class ScriptedLec:
    """Coils, inputs and registers, and what was written to them in order; what follows a write is the test's."""

    def __init__(self):
        self.coils = dict.fromkeys(range(0x10, 0x40), False)
        self.inputs = dict.fromkeys(range(0x40, 0x50), False)
        self.registers = dict.fromkeys(range(0x9000, 0x9120), 0)
        self.written = []
        self.follows_servo = True
        self.reopened = 0

    def read_coils(self, address, number):
        return [self.coils[address + i] for i in range(number)]

    def read_inputs(self, address, number):
        return [self.inputs[address + i] for i in range(number)]

    def read_registers(self, address, number):
        return [self.registers[address + i] for i in range(number)]

    def write_coil(self, address, *, on):
        self.written.append((address, on))
        self.coils[address] = on
        if address == SERVO and self.follows_servo:
            self.inputs[READY] = on

    def write_registers(self, address, words):
        self.written.append((address, list(words)))
        self.registers |= {address + i: word for i, word in enumerate(words)}

    def stand_at(self, position):
        self.registers |= dict(zip((PRESENT, PRESENT + 1), words_of([position]), strict=True))

    def take_move(self):
        self.registers[START] = 0
        self.registers |= {PRESENT + 4 + i: self.registers[OPERATION + 2 + i] for i in range(2)}

    def reopen(self):
        self.reopened += 1


@pytest.fixture
def lec():
    lec = ScriptedLec()
    for on in (READY, HOMED):
        lec.inputs[on] = True
    return lec


@pytest.fixture
def make_stage(lec, clock):
    def make(**parameters):
        parameters = {"velocity_deg_s": 40, "acceleration_deg_s2": 1000} | parameters
        return SmcLec(lec, clock, name="sample_azimuth", **parameters)

    return make


@pytest.fixture
def stage(make_stage):
    return make_stage()


@pytest.mark.usefixtures("no_real_grace")
class TestConnecting:
    def test_takes_control_and_switches_the_servo_on_without_a_motion(self, stage, lec):
        lec.inputs[READY] = False
        assert stage.connect() == ()
        assert lec.written == [(SERIAL, True), (SERVO, True)]

    def test_left_over_alarm_is_refused_and_stays(self, stage, lec):
        lec.inputs[ALARM] = True
        with pytest.raises(DeviceFaultError, match=r"has an alarm.*then: goniometer home --axis sample_azimuth"):
            stage.connect()
        assert lec.written == [(SERIAL, True)]

    def test_left_over_alarm_is_reset_for_who_asks_for_homing_and_told(self, make_stage, lec, monkeypatch):
        stage = make_stage(may_reset_alarm=True)
        lec.inputs[ALARM] = True
        write = lec.write_coil

        def reset(address, *, on):
            write(address, on=on)
            lec.inputs[ALARM] &= not (address == RESET and not on)

        monkeypatch.setattr(lec, "write_coil", reset)
        assert stage.connect() == ("an alarm, which was reset",)
        assert lec.written == [(SERIAL, True), (RESET, True), (RESET, False), (SERVO, True)]

    def test_left_over_hold_of_a_table_at_its_target_is_simply_ended(self, stage, lec):
        lec.coils[HOLD] = True
        assert stage.connect() == ()
        assert lec.written[1:] == [(HOLD, False), (SERVO, True)]

    @pytest.mark.parametrize("kept", ["way", "start", "busy", "homing"])
    def test_left_over_motion_is_ended_only_with_the_servo_off(self, stage, lec, kept):
        lec.coils[HOLD] = True
        lec.stand_at(200 * (kept == "way"))
        lec.registers[START] = 0x0100 * (kept == "start")
        lec.inputs[BUSY], lec.coils[SET_UP] = kept == "busy", kept == "homing"
        assert stage.connect() == ("a motion on hold, which was given up",)
        assert lec.written[1:] == [(SERVO, False), (SET_UP, False), (HOLD, False), (SERVO, True), (SERVO, True)]

    def test_alarm_that_stays_is_a_fault(self, make_stage, lec):
        stage = make_stage(may_reset_alarm=True)
        lec.inputs[ALARM] = True
        with pytest.raises(DeviceFaultError, match=r"sample_azimuth: its alarm cannot be reset"):
            stage.connect()

    def test_alarm_input_that_is_low_at_an_alarm(self, make_stage, lec):
        stage = make_stage(registers=LecRegisters(alarm_level=False))
        lec.inputs[ALARM] = True
        assert stage.connect() == ()
        lec.inputs[ALARM] = False
        with pytest.raises(DeviceFaultError, match="the controller has an alarm"):
            stage.start_move(10)

    def test_servo_that_stays_off_is_a_fault(self, stage, lec):
        lec.follows_servo = lec.inputs[READY] = False
        with pytest.raises(DeviceFaultError, match="its servo stays off"):
            stage.connect()

    def test_emergency_stop_is_a_fault_before_anything_is_switched(self, stage, lec):
        lec.inputs[EMERGENCY_STOP] = True
        with pytest.raises(DeviceFaultError, match="its emergency stop is pressed"):
            stage.connect()
        assert lec.written == [(SERIAL, True)]


class TestMoving:
    def test_whole_block_then_start(self, stage, lec):
        stage.start_move(150)
        assert lec.written == [
            (OPERATION, [1, 40, 0, 15000, 1000, 1000, 0, 0, 0, 100, 0, 0, 0, 0, 0, 10]),
            (START, [0x0100]),
        ]

    def test_firmware_with_the_words_the_other_way(self, make_stage, lec):
        stage = make_stage(registers=LecRegisters(start_word=0x0001, absolute_word=0x0100))
        stage.start_move(-0.01)
        assert lec.registers[OPERATION] == 0x0100
        assert int32s(lec.read_registers(OPERATION + 2, 2)) == [-1]
        assert lec.written[-1] == (START, [0x0001])

    def test_moves_until_it_is_not_busy(self, stage, lec):
        stage.start_move(150)
        assert stage.is_moving()  # not taken up yet
        lec.take_move()
        assert stage.is_moving()  # not busy yet
        lec.inputs[BUSY] = True
        lec.stand_at(7000)
        assert stage.is_moving()
        assert stage.position_deg() == 70
        lec.inputs[BUSY] = False
        lec.stand_at(15000)
        assert not stage.is_moving()
        assert not stage.is_moving()

    def test_move_that_was_over_between_two_looks_has_ended(self, stage, lec):
        stage.start_move(150)
        lec.take_move()
        lec.stand_at(15001)
        assert not stage.is_moving()

    def test_axis_that_stands_at_its_old_target_has_not_ended_before_it_was_taken(self, stage, lec):
        lec.stand_at(15000)
        stage.start_move(150)
        assert stage.is_moving()
        lec.take_move()
        assert not stage.is_moving()

    @pytest.mark.parametrize("lacking", ["the start", "the target"])
    def test_axis_at_its_target_has_not_ended_while_the_move_is_not_taken(self, stage, lec, lacking):
        lec.stand_at(15000)
        stage.start_move(150)
        lec.take_move()
        if lacking == "the start":
            lec.registers[START] = 0x0100
        else:
            lec.registers[PRESENT + 5] = 7000
        assert stage.is_moving()

    @pytest.mark.usefixtures("no_real_grace")
    @pytest.mark.parametrize("taken", [False, True])
    def test_move_that_is_ignored_is_a_fault(self, stage, lec, clock, taken):
        stage.start_move(150)
        if taken:
            lec.take_move()
        clock.time_s = 0.499
        assert stage.is_moving()
        clock.time_s = 0.501
        with pytest.raises(
            DeviceFaultError, match=r"has not done what it was told\. Not done: the move to 150 degrees"
        ):
            stage.is_moving()

    @pytest.mark.parametrize(
        ("number", "value", "text"),
        [
            (ALARM, True, "the controller has an alarm"),
            (EMERGENCY_STOP, True, "its emergency stop is pressed"),
            (READY, False, "its servo is off"),
            (HOMED, False, "it does not know its origin"),
        ],
    )
    def test_fault_before_and_during_a_move(self, stage, lec, number, value, text):
        stage.start_move(150)
        lec.inputs[BUSY] = True
        assert stage.is_moving()
        lec.inputs[number] = value
        for use in (stage.is_moving, lambda: stage.start_move(150)):
            with pytest.raises(DeviceFaultError, match=rf"sample_azimuth: {text}.*Not done: the move to 150 degrees"):
                use()
            lec.inputs[BUSY] = False

    def test_move_while_it_moves_is_refused(self, stage, lec):
        lec.inputs[BUSY] = True
        with pytest.raises(DeviceFaultError, match="it still moves"):
            stage.start_move(150)
        assert lec.written == []

    @pytest.mark.parametrize("key", ["velocity_deg_s", "acceleration_deg_s2"])
    @pytest.mark.parametrize("value", [0, -1, 12.5, 65536])
    def test_speed_that_the_controller_cannot_hold_is_refused(self, make_stage, key, value):
        with pytest.raises(ConfigurationError, match=rf"sample_azimuth: {key} is {value:g}; allowed: whole numbers"):
            make_stage(**{key: value})


class TestHoming:
    def test_from_the_request_to_the_origin(self, stage, lec):
        lec.inputs[HOMED] = False
        assert not stage.is_homed()
        stage.start_homing()
        assert lec.written == [(SET_UP, False), (SET_UP, True)]
        assert stage.is_moving()
        lec.inputs[BUSY] = True
        assert stage.is_moving()
        lec.inputs[BUSY], lec.inputs[HOMED] = False, True
        assert not stage.is_moving()
        assert lec.coils[SET_UP] is False
        assert stage.is_homed()

    @pytest.mark.usefixtures("no_real_grace")
    @pytest.mark.parametrize("homed", [False, True])
    def test_request_that_is_ignored_is_a_fault(self, stage, lec, clock, homed):
        lec.inputs[HOMED] = homed
        stage.start_homing()
        assert stage.is_moving()
        clock.time_s = 0.501
        with pytest.raises(DeviceFaultError, match=r"Not done: the return to the origin"):
            stage.is_moving()

    @pytest.mark.usefixtures("no_real_grace")
    def test_search_that_ends_without_an_origin_is_a_fault(self, stage, lec, clock):
        lec.inputs[HOMED] = False
        stage.start_homing()
        lec.inputs[BUSY] = True
        clock.time_s = 20
        assert stage.is_moving()
        lec.inputs[BUSY] = False
        assert stage.is_moving()
        clock.time_s = 20.51
        with pytest.raises(DeviceFaultError, match="has not done what it was told"):
            stage.is_moving()


class TestStopping:
    def test_stop_is_one_write(self, stage, lec):
        stage.start_move(150)
        lec.written.clear()
        stage.stop()
        assert lec.written == [(HOLD, True)]

    def test_stopped_axis_moves_until_its_speed_is_zero_even_if_it_stays_busy(self, stage, lec):
        stage.start_move(150)
        lec.inputs[BUSY] = True
        stage.stop()
        lec.registers[PRESENT + 2] = 12
        assert stage.is_moving()
        lec.registers[PRESENT + 2] = 0
        assert not stage.is_moving()

    def test_next_move_gives_the_held_one_up_before_the_hold_ends(self, stage, lec):
        stage.start_move(150)
        stage.stop()
        lec.written.clear()
        stage.start_move(10)
        coils = [write for write in lec.written if write[0] < 0x9000]
        assert coils == [(SERVO, False), (SET_UP, False), (HOLD, False), (SERVO, True)]
        assert lec.written[-1] == (START, [0x0100])

    def test_home_that_was_lost_with_the_servo_is_noticed(self, stage, lec, monkeypatch):
        lec.stand_at(200)
        stage.stop()
        write = lec.write_coil

        def lose_home(address, *, on):
            write(address, on=on)
            lec.inputs[HOMED] &= address != SERVO

        monkeypatch.setattr(lec, "write_coil", lose_home)
        with pytest.raises(DeviceFaultError, match="it does not know its origin"):
            stage.start_move(10)

    def test_reconnects_once(self, stage, lec):
        stage.reconnect()
        assert lec.reopened == 1


def with_crc(frame: bytes) -> bytes:
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return frame + struct.pack("<H", crc)


def rtu(text: str) -> bytes:
    return with_crc(bytes.fromhex(text))


def split(received: bytes) -> tuple[bytes, bytes, bytes]:
    length = 9 + received[6] if received[1:2] == b"\x10" and len(received) > 6 else 8
    return (received[:length], b"!", received[length:]) if len(received) >= length else (b"", b"", received)


POSITION = rtu("01 03 9000 0006")
SERVO_ON = bytes.fromhex("01 05 00 19 FF 00 5D FD")
STARTED = bytes.fromhex("01 10 91 00 00 01 02 01 00 27 09")
HOLD_ON = rtu("01 05 0018 FF00")
BLOCK = rtu("01 10 9102 0010 20 0001 0028 00003A98 03E8 03E8 0000 0000 0000 0064 00000000 00000000 0000000A")
AT_150 = rtu("01 03 0C 00003A98 0000 0000 00003A98")
INPUTS = rtu("01 02 0048 0008")
ANSWERS = {
    POSITION: AT_150,
    rtu("01 05 0030 FF00"): rtu("01 05 0030 FF00"),
    INPUTS: rtu("01 02 01 06"),
    rtu("01 01 0018 0001"): rtu("01 01 01 00"),
    SERVO_ON: SERVO_ON,
    BLOCK: rtu("01 10 9102 0010"),
    STARTED: rtu("01 10 9100 0001"),
    rtu("01 03 9100 0001"): rtu("01 03 02 0000"),
    HOLD_ON: HOLD_ON,
}


class TestBytes:
    """The sheet's frames where it has them, and faults on the line."""

    @pytest.fixture
    def wired(self, make_peer, clock):
        ports = []

        def make(changes=None, reply_timeout_s=2.0):
            peer = make_peer(ANSWERS | (changes or {}), split=split)
            ports.append(ModbusPort(peer.port, device="line", reply_timeout_s=reply_timeout_s))
            unit = ModbusUnit(ports[-1], 1, device="sample_azimuth")
            return peer, SmcLec(unit, clock, name="sample_azimuth", velocity_deg_s=40, acceleration_deg_s2=1000)

        yield make
        for port in ports:
            port.close()

    def test_connects_and_moves_with_the_sheets_frames(self, wired):
        peer, stage = wired()
        assert stage.connect() == ()
        assert SERVO_ON in peer.commands
        stage.start_move(150)
        assert peer.commands[-2:] == [BLOCK, STARTED]
        assert not stage.is_moving()
        assert stage.position_deg() == 150.0

    def test_other_drive_at_this_address_is_refused(self, wired):
        _, stage = wired({POSITION: rtu("01 83 02")})
        with pytest.raises(DeviceFaultError, match=r"exception 2, illegal address.*device is of the family"):
            stage.connect()

    @pytest.mark.parametrize("lost", [b"", bytes.fromhex("01 10 91 00"), rtu("01 10 9100 0001")[:-1] + b"\x00"])
    def test_start_whose_answer_is_lost_is_an_error_and_is_not_repeated(self, wired, lost):
        peer, stage = wired({STARTED: lost}, reply_timeout_s=0.05)
        with pytest.raises(ReplyTimeoutError, match="no valid answer to the write to 0x9100 of unit 1"):
            stage.start_move(150)
        stage.stop()
        assert peer.commands.count(STARTED) == 1
        assert peer.commands[-1] == HOLD_ON

    def test_vanished_controller_is_not_connected_and_may_come_back(self, wired):
        loop_back = rtu("01 08 0000 0001")
        peer, stage = wired({loop_back: loop_back})
        stage.connect()
        peer.vanish()
        with pytest.raises(NotConnectedError, match=r"sample_azimuth: the link on port .* is gone"):
            stage.position_deg()
        stage.reconnect()
        assert stage.position_deg() == 150.0
        assert peer.connections == 2
