"""The Elliptec drivers against a table of answers in bytes; positions and the identity are the fact sheet's."""

from __future__ import annotations

import random
import select
import time

import pytest

from drivers.axis import Axis
from drivers.thorlabs_elliptec.bus import ElliptecBus
from drivers.thorlabs_elliptec.packets import (
    Identity,
    Packet,
    command,
    hex_pulses,
    identity_of,
    parse_packet,
    status_text,
)
from drivers.thorlabs_elliptec.rotator import ElliptecRotator
from drivers.thorlabs_elliptec.slider import ElliptecSlider
from drivers.travel import Travel
from drivers.wire.framing import take_frame
from goniometer.errors import (
    ConfigurationError,
    DeviceFaultError,
    LimitError,
    NotConnectedError,
    PositionError,
    ReplyError,
    ReplyTimeoutError,
)

IDENTITY = b"0IN0E1140028420211401016800023000\r\n"
MOTOR = b"0I1100FFFFFFFFFFF00AC00A5\r\n"
DATA = {"ho": 1, "ma": 8, "mr": 8, "sv": 2, "sj": 8}
ANSWERS = {
    b"0in": IDENTITY,
    b"0i1": MOTOR,
    b"0gs": b"0GS00\r\n",
    b"0gp": b"0PO00000000\r\n",
    b"0sv64": b"0GS00\r\n",
    b"0gv": b"0GV64\r\n",
    b"0st": b"0GS00\r\n",
    b"0ho0": b"0PO00000000\r\n",
    b"0sj00000466": b"0GS00\r\n",
    b"0sj00000467": b"0GS00\r\n",
    b"0gj": b"0GJ00000467\r\n",
    b"0go": b"0HO00000000\r\n",
}


def split(received: bytes) -> tuple[bytes, bytes, bytes]:
    """Split off one packet of the length that its letters say: packet, whether there is one, rest."""
    received = received.lstrip(b"\r\n")
    length = 3 + DATA.get(received[1:3].decode("latin-1"), 0)
    whole = len(received) >= length
    return (received[:length], b"!", received[length:]) if whole else (b"", b"", received)


def at_address(address: int, answers: dict[bytes, bytes]) -> dict[bytes, bytes]:
    digit = f"{address:X}".encode()
    return {digit + packet[1:]: digit + answer[1:] for packet, answer in answers.items()}


PACKETS = [
    (b"0GS00\r\n", Packet(0, "GS", "00")),
    (b"FGS0D\r\n", Packet(15, "GS", "0D")),
    (b"0PO00004600\r\n", Packet(0, "PO", "00004600")),
    (IDENTITY, Packet(0, "IN", "0E1140028420211401016800023000")),
    (MOTOR, Packet(0, "I1", "100FFFFFFFFFFF00AC00A5")),
    (b"3BO00000020\r\n", Packet(3, "BO", "00000020")),
    (b"0GJ00000467\r\n", Packet(0, "GJ", "00000467")),
]


@pytest.mark.parametrize(("sent", "packet"), PACKETS)
@pytest.mark.parametrize("trailing", [b"", b"0", b"0PO0000"])
def test_packet_fed_whole(sent, packet, trailing):
    received = bytearray(sent + trailing)
    assert parse_packet(take_frame(received, b"\r\n")) == packet
    assert received == trailing


@pytest.mark.parametrize(("sent", "packet"), PACKETS)
def test_packet_fed_byte_by_byte(sent, packet):
    received = bytearray()
    lines = []
    for byte in sent:
        received.append(byte)
        lines.append(take_frame(received, b"\r\n"))
    assert lines[:-1] == [None] * (len(sent) - 1)
    assert parse_packet(lines[-1]) == packet


@pytest.mark.parametrize(
    "line",
    [b"", b"0", b"0GS", b"0GS0", b"0GS000", b"GGS00", b"0gs00", b"0PO0000460", b"0PO0000460G", b"x0GS00", b"0\xff"],
)
def test_line_that_is_no_packet(line):
    assert parse_packet(line) is None


def test_numbers_are_those_of_the_sheet():
    assert identity_of(parse_packet(IDENTITY.strip())) == Identity(14, "11400284", 360, 143_360)
    assert Packet(0, "PO", "FFFFEE80").pulses == -4480
    assert command(0, "ma", hex_pulses(0x4600)) == b"0ma00004600"
    assert command(0, "mr", hex_pulses(-4480)) == b"0mrFFFFEE80"
    assert command(12, "gp") == b"Cgp"
    assert status_text(0x0D) == "over-current"
    assert status_text(0x0E) == "status 0x0E, which is not in its manual"


def test_parser_survives_mutated_packets():
    rng = random.Random(3)
    taken = 0
    for _ in range(30_000):
        line = bytearray(rng.choice(PACKETS)[0])
        for _ in range(rng.randrange(1, 4)):
            line[rng.randrange(len(line))] = rng.randrange(256)
        packet = parse_packet(bytes(line).strip())
        if packet is not None:
            taken += 1
            assert command(packet.address, packet.kind, packet.data) == bytes(line).strip()
            assert -(1 << 31) <= packet.pulses < 1 << 120
    assert taken > 100


@pytest.fixture
def bus(make_peer, open_link, clock):
    """A bus whose clock stands still, and its modules' table of answers."""

    def make(answers, reply_timeout_s=2.0):
        peer = make_peer(answers, split=split)
        return peer, ElliptecBus(open_link(peer.port, "analyzer bus", reply_timeout_s), clock)

    return make


@pytest.fixture
def rotator(bus):
    def make(changes=None, **kwargs):
        peer, wire = bus(ANSWERS | (changes or {}), **kwargs)
        return peer, rotator_on(wire)

    return make


def rotator_on(wire: ElliptecBus, address: int = 0, name: str = "polarizer", **kwargs) -> ElliptecRotator:
    speed = {"velocity_deg_s": 430, "acceleration_deg_s2": 4700} | kwargs
    return ElliptecRotator(wire, address, name=name, **speed)


def ended(device, until):
    until(lambda: not device.is_moving())


def arrive(device, clock):
    give_up_s = time.monotonic() + 10
    while device.is_moving():
        assert time.monotonic() < give_up_s, "never arrives"
        clock.time_s += 0.001


MA_45 = b"0ma00004600"


def test_connects_without_moving(rotator):
    peer, rotator = rotator({b"0gj": b"0GJ00004600\r\n"})
    assert rotator.connect() == ()
    assert peer.commands == [b"0in", b"0gs", b"0sv64", b"0gv", b"0go"]
    assert not rotator.is_homed()
    assert not rotator.is_moving()


def test_error_left_from_before_is_returned(rotator):
    _, rotator = rotator({b"0gs": b"0GS0D\r\n"})
    assert rotator.connect() == ("over-current",)


def test_home_offset_is_noted_once_and_must_stay(rotator):
    offsets = [b"0HOFFFFEE80\r\n", b"0HOFFFFEE80\r\n", b"0HO00000000\r\n"]
    _, rotator = rotator({b"0go": offsets})
    (note,) = rotator.connect()
    assert note.startswith("polarizer has a home offset of -11.25 degrees")
    assert rotator.connect() == ()
    with pytest.raises(DeviceFaultError, match=r"polarizer: its home offset is 0 degrees, and should be -11\.25"):
        rotator.connect()


def test_home_offset_of_the_rig_file_is_demanded(bus):
    _, wire = bus(ANSWERS | {b"0go": b"0HO00004600\r\n"})
    assert rotator_on(wire, home_offset_deg=45.0).connect() == ()
    with pytest.raises(DeviceFaultError, match=r"its home offset is 45 degrees, and should be 0: .*home_offset_deg"):
        rotator_on(wire, home_offset_deg=0.0).connect()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({b"0in": b"0IN091140028420211401006000000001\r\n"}, "address 0 is of type 9 .* not one of ELL8, ELL14, ELL18"),
        ({b"0in": b"0IN0E1140028420211401016800000000\r\n"}, "and 0 pulses"),
        ({b"0gv": b"0GV32\r\n"}, "keeps its velocity at 50 percent, not 100"),
        ({b"0sv64": b"0GS04\r\n"}, "answers '0sv64' with status 4, value out of range"),
    ],
)
def test_module_that_cannot_be_set_up_is_refused(rotator, changes, message):
    _, rotator = rotator(changes)
    with pytest.raises(DeviceFaultError, match=f"polarizer: .*{message}"):
        rotator.connect()


@pytest.mark.parametrize("velocity_deg_s", [2, 440])
def test_velocity_that_the_module_has_not_is_refused(bus, velocity_deg_s):
    with pytest.raises(ConfigurationError, match=r"polarizer: velocity_deg_s .* percent of an Elliptec module's 430"):
        rotator_on(bus({})[1], velocity_deg_s=velocity_deg_s)


def test_absent_address_is_told(bus):
    peer, wire = bus(ANSWERS, reply_timeout_s=0.1)
    with pytest.raises(ReplyTimeoutError, match="plate: no answer to '5in' from the module with address 5"):
        rotator_on(wire, 5, "plate").connect()
    rotator_on(wire).connect()
    assert peer.commands[:4] == [b"5in", b"5in", b"5in", b"0in"]


def test_module_that_falls_silent_is_given_up(rotator):
    silent = {b"0in": [IDENTITY, b""], b"0i1": b"", b"0gp": b""}
    peer, rotator = rotator(silent, reply_timeout_s=0.2)
    rotator.connect()
    with pytest.raises(ReplyTimeoutError, match="polarizer: no answer to '0i1'"):
        rotator.position_deg()
    assert peer.commands[-3:] == [b"0gp", b"0in", b"0i1"]


def test_move_is_the_sheets_and_comes_a_tenth_of_a_second_after_an_answer(rotator, clock, until):
    peer, rotator = rotator({MA_45: b""})
    rotator.connect()
    rotator.start_move(45)
    clock.time_s += 0.1 - 1e-6
    assert rotator.is_moving()
    assert MA_45 not in peer.commands
    clock.time_s += 2e-6
    assert rotator.is_moving()
    until(lambda: peer.commands[-1] == MA_45)
    assert rotator.is_moving()
    peer.say(b"0PO000045F8\r\n")
    ended(rotator, until)
    assert peer.commands.count(MA_45) == 1


def test_position_is_read_in_the_pulses_that_the_module_names(rotator):
    _, rotator = rotator({b"0gp": [b"0PO00004600\r\n", b"0POFFFFFFFD\r\n"]})
    rotator.connect()
    assert rotator.position_deg() == 45.0
    assert rotator.position_deg() == pytest.approx(-3 * 360 / 143_360)


def test_position_is_read_in_the_pulses_of_another_model(rotator):
    _, rotator = rotator({b"0in": b"0IN081140028420211401016800040000\r\n", b"0gp": b"0PO00004000\r\n"})
    rotator.connect()
    assert rotator.position_deg() == 22.5


def test_another_module_at_the_address_is_not_taken_for_the_one_before(rotator):
    other = IDENTITY.replace(b"11400284", b"11400285")
    _, rotator = rotator({b"0in": [IDENTITY, other]})
    rotator.connect()
    rotator.reconnect()
    with pytest.raises(DeviceFaultError, match="another device answers since the link was lost: '0E11400285"):
        rotator.connect()


@pytest.mark.parametrize("interim", [b"0GS09\r\n", b"0GS09\r\n0GS09\r\n"])
def test_busy_is_not_the_end_of_a_move(rotator, clock, until, interim):
    peer, rotator = rotator({MA_45: interim + b"0BO00000001\r\n"})
    rotator.connect()
    clock.time_s += 1
    rotator.start_move(45)
    until(lambda: rotator.is_moving() and rotator._module._bus.unsolicited == 1)
    assert rotator.is_moving()
    peer.say(b"0PO00004600\r\n")
    ended(rotator, until)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (b"0GS02\r\n", "status 2, mechanical time-out"),
        (b"0GS0D\r\n", "status 13, over-current"),
        (b"0GS09\r\n0GS0C\r\n", "status 12, out of range"),
        (b"0GS1F\r\n", "status 31, status 0x1F, which is not in its manual"),
    ],
)
def test_failed_move_is_a_fault_with_its_text(rotator, clock, until, answer, message):
    peer, rotator = rotator({MA_45: answer})
    rotator.connect()
    clock.time_s += 1
    rotator.start_move(45)
    with pytest.raises(DeviceFaultError, match=f"polarizer: the module answers '0ma00004600' with {message}"):
        ended(rotator, until)
    assert peer.commands.count(MA_45) == 1
    assert not rotator.is_moving()


@pytest.mark.parametrize("answer", [b"0PO0000460\r\n", b"\xff\xfe0PO00004600\r\n", b"0GV64\r\n"])
def test_garbled_answer_to_a_move_is_an_error_and_the_move_is_not_repeated(rotator, clock, until, answer):
    peer, rotator = rotator({MA_45: answer})
    rotator.connect()
    clock.time_s += 1
    rotator.start_move(45)
    with pytest.raises(ReplyError, match=r"polarizer: the answer to '0ma00004600' is .* which is not PO or GS"):
        ended(rotator, until)
    assert peer.commands.count(MA_45) == 1


@pytest.mark.usefixtures("no_real_grace")
def test_move_without_an_answer_is_given_up_after_four_seconds(rotator, clock):
    peer, rotator = rotator({MA_45: b""})
    rotator.connect()
    clock.time_s = 10.0
    rotator.start_move(45)
    clock.time_s = 14 - 1e-6
    assert rotator.is_moving()
    clock.time_s = 14 + 1e-6
    with pytest.raises(ReplyTimeoutError, match="polarizer: no answer to '0ma00004600' from the module with address 0"):
        rotator.is_moving()
    assert rotator.position_deg() == 0.0
    assert peer.commands.count(MA_45) == 1


@pytest.mark.usefixtures("no_real_grace")
@pytest.mark.parametrize("proof", [b"0in", b"0i1"])
def test_late_end_of_a_move_is_not_taken_for_the_position(rotator, clock, proof):
    """After a move that was given up, a module is asked for what cannot be mistaken; its late answer comes first."""
    late = {proof: b"0PO00004600\r\n0GS02\r\n" + ANSWERS[proof]}
    peer, rotator = rotator({MA_45: b""})
    rotator.connect()
    peer._answers |= {packet: [answer] for packet, answer in late.items()}
    if proof == b"0i1":
        next(rotator._module._bus._proofs)
    clock.time_s = 10.0
    rotator.start_move(45)
    clock.time_s = 15.0
    with pytest.raises(ReplyTimeoutError, match="0ma"):
        rotator.is_moving()
    assert rotator.position_deg() == 0.0
    assert peer.commands[-2:] == [proof, b"0gp"]


def test_second_move_in_motion_is_refused(rotator, clock):
    _, rotator = rotator({MA_45: b""})
    rotator.connect()
    clock.time_s += 1
    rotator.start_move(45)
    for start in (rotator.start_homing, lambda: rotator.start_move(0)):
        with pytest.raises(DeviceFaultError, match="polarizer: the module has not ended its last motion"):
            start()


def test_target_that_has_no_packet_is_refused_before_the_first_byte(rotator):
    peer, rotator = rotator()
    rotator.connect()
    with pytest.raises(LimitError, match="more than the module can count"):
        rotator.start_move(1e7)
    assert peer.commands[-1] == b"0go"


def test_homing_leaves_a_mark_that_shows_whether_the_module_was_switched_off(rotator, clock):
    peer, rotator = rotator({b"0gj": [b"0GJ00000467\r\n", b"0GJ00001180\r\n"]})
    rotator.connect()
    clock.time_s += 1
    rotator.start_homing()
    arrive(rotator, clock)
    assert peer.commands[-3:] == [b"0sj00000466", b"0ho0", b"0sj00000467"]
    assert rotator.is_homed()
    assert not rotator.is_homed()


def test_failed_homing_leaves_the_module_without_a_home(rotator, clock):
    peer, rotator = rotator({b"0ho0": b"0GS0A\r\n", b"0gj": b"0GJ00000466\r\n"})
    rotator.connect()
    rotator.start_homing()
    with pytest.raises(DeviceFaultError, match="'0ho0' with status 10, sensor error"):
        arrive(rotator, clock)
    assert not rotator.is_homed()
    assert b"0sj00000467" not in peer.commands


def test_stop_is_sent_at_once_and_what_comes_after_it_is_dropped(rotator, clock, until):
    proof = b"0PO00003FFF\r\n" + MOTOR
    peer, rotator = rotator({MA_45: b"", b"0i1": proof, b"0in": [IDENTITY, b"0PO00003FFF\r\n" + IDENTITY]})
    rotator.connect()
    clock.time_s += 1
    rotator.start_move(45)
    until(lambda: peer.commands[-1] == MA_45)
    rotator.stop()
    assert peer.commands[-1] == b"0st"
    assert not rotator.is_moving()
    assert rotator.position_deg() == 0.0


def test_move_that_a_stop_cannot_end_is_seen_to_its_end_and_no_other_is_begun_before(rotator, clock, until):
    """A module that still moves says "busy" to the next move, and then where the last one ended: no answer to it."""
    peer, rotator = rotator({MA_45: b"", b"0st": b"0GS09\r\n", b"0ma00000000": b"0PO00000000\r\n"})
    rotator.connect()
    clock.time_s += 1
    rotator.start_move(45)
    until(lambda: peer.commands[-1] == MA_45)
    rotator.stop()
    peer._answers |= {b"0gs": [b"0GS09\r\n"]}
    for _ in range(3):
        assert rotator.is_moving()
    for start in (rotator.start_homing, lambda: rotator.start_move(0)):
        with pytest.raises(DeviceFaultError, match="polarizer: the module has not ended its last motion"):
            start()
    peer._answers |= {b"0gs": [b"0GS00\r\n"]}
    ended(rotator, until)
    clock.time_s += 1
    rotator.start_move(0)
    ended(rotator, until)
    assert peer.commands[-1] == b"0ma00000000"


def test_module_that_another_program_has_left_in_motion_is_waited_for(rotator):
    peer, rotator = rotator({b"0gs": [b"0GS09\r\n", b"0GS09\r\n", b"0GS02\r\n"]})
    assert rotator.connect() == ()
    with pytest.raises(DeviceFaultError, match="has not ended its last motion"):
        rotator.start_move(45)
    with pytest.raises(DeviceFaultError, match="last motion has ended with status 2, mechanical time-out"):
        rotator.is_moving()
    assert MA_45 not in peer.commands


def test_module_that_was_switched_off_on_the_way_has_lost_its_home(rotator, clock, until):
    peer, rotator = rotator({MA_45: b"0PO00004600\r\n", b"0gj": [b"0GJ00000467\r\n", b"0GJ00004600\r\n"]})
    rotator.connect()
    clock.time_s += 1
    rotator.start_homing()
    arrive(rotator, clock)
    assert rotator.is_homed()
    clock.time_s += 1
    rotator.start_move(45)
    with pytest.raises(DeviceFaultError, match="polarizer: the module has lost its home position"):
        ended(rotator, until)
    assert peer.commands[-2:] == [MA_45, b"0gj"]


def test_stop_drops_a_move_that_was_not_sent_yet(rotator, clock):
    peer, rotator = rotator()
    rotator.connect()
    rotator.start_move(45)
    rotator.stop()
    clock.time_s += 1
    assert not rotator.is_moving()
    assert rotator.position_deg() == 0.0
    assert MA_45 not in peer.commands


def test_stop_without_an_answer_is_an_error(rotator, until):
    peer, rotator = rotator({b"0st": b""}, reply_timeout_s=0.02)
    with pytest.raises(ReplyTimeoutError, match="polarizer: no answer to '0st'"):
        rotator.stop()
    until(lambda: peer.commands == [b"0st"])


def test_stop_that_is_refused_has_got_through(rotator):
    peer, rotator = rotator({b"0st": b"0GS03\r\n"})
    rotator.stop()
    assert peer.commands == [b"0st"]


TWO = ANSWERS | at_address(1, ANSWERS)


@pytest.fixture
def two(bus, clock):
    """Two rotators on one bus, connected, and a tenth of a second of silence behind them."""

    def make(changes=None, **kwargs):
        peer, wire = bus(TWO | (changes or {}), **kwargs)
        pair = rotator_on(wire), rotator_on(wire, 1, "plate")
        for rotator in pair:
            rotator.connect()
        clock.time_s += 1
        return peer, *pair

    return make


def test_no_module_is_spoken_to_while_another_has_an_answer_outstanding(two, clock, until):
    peer, polarizer, plate = two({MA_45: b"", b"1ma00008C00": b""})
    polarizer.start_move(45)
    plate.start_move(90)
    until(lambda: peer.commands[-1] == MA_45)
    clock.time_s += 1
    for _ in range(20):
        assert [polarizer.is_moving(), plate.is_moving()] == [True, True]
    assert peer.commands[-1] == MA_45
    peer.say(b"0PO00004600\r\n")
    ended(polarizer, until)
    assert plate.is_moving()
    assert peer.commands[-1] == MA_45
    clock.time_s += 0.11
    assert plate.is_moving()
    until(lambda: peer.commands[-2:] == [MA_45, b"1ma00008C00"])
    peer.say(b"1PO00008C00\r\n")
    ended(plate, until)


def test_question_to_another_module_waits_for_the_end_of_a_motion(two, until):
    peer, polarizer, plate = two({MA_45: b""})
    polarizer.start_move(45)
    until(lambda: peer.commands[-1] == MA_45)
    peer.say(b"0GS09\r\n0PO00004600\r\n")
    assert plate.position_deg() == 0.0
    assert peer.commands[-2:] == [MA_45, b"1gp"]
    assert not polarizer.is_moving()


def test_failure_of_one_module_is_not_the_others(two, clock, until):
    _, polarizer, plate = two({MA_45: b"0GS02\r\n", b"1ma00008C00": b"1PO00008C00\r\n"})
    polarizer.start_move(45)
    plate.start_move(90)
    wire = polarizer._module._bus
    until(lambda: len(wire._queue) < 2 and plate.is_moving() and wire._active is None)
    clock.time_s += 1
    ended(plate, until)
    with pytest.raises(DeviceFaultError, match="polarizer: "):
        polarizer.is_moving()


def test_stop_of_a_module_at_rest_says_nothing_while_another_moves(two, until):
    peer, polarizer, plate = two({MA_45: b""})
    polarizer.start_move(45)
    until(lambda: peer.commands[-1] == MA_45)
    plate.stop()
    polarizer.stop()
    assert peer.commands[-2:] == [MA_45, b"0st"]


def test_buttons_are_counted_and_are_no_answers(rotator, clock, until):
    peer, rotator = rotator({b"0gp": b"0BS00\r\n0BO00001234\r\n0PO00004600\r\n", MA_45: b"0BO00000001\r\n"})
    rotator.connect()
    assert rotator.position_deg() == 45.0
    clock.time_s += 1
    rotator.start_move(45)
    until(lambda: rotator.is_moving() and rotator._module._bus.unsolicited == 3)
    peer.say(b"0PO00004600\r\n")
    ended(rotator, until)


@pytest.mark.parametrize("noise", [b"\x00", b"0PO0000", b"\xff" * 50, b"0PO00001111\r\n", b"garbage\r\n"])
def test_noise_before_a_question_does_no_harm(rotator, noise, until):
    peer, rotator = rotator({b"0gp": b"0PO00004600\r\n"})
    rotator.connect()
    peer.say(noise)
    until(rotator._module._bus._link.has_input)
    assert rotator.position_deg() == 45.0
    assert peer.commands.count(b"0gp") == 1


def test_garbled_answer_to_a_question_is_asked_for_again(rotator):
    peer, rotator = rotator({b"0gp": [b"0PO0004600\r\n", b"0PO00004600\r\n"]})
    rotator.connect()
    assert rotator.position_deg() == 45.0
    assert peer.commands.count(b"0gp") == 2


def test_answer_from_another_address_is_not_taken(rotator):
    _, rotator = rotator({b"0gp": b"1PO00001111\r\n0PO00004600\r\n"})
    rotator.connect()
    assert rotator.position_deg() == 45.0


def test_bus_that_never_ends_its_line_is_refused(rotator):
    _, rotator = rotator({b"0gp": b"x" * 10_000})
    rotator.connect()
    with pytest.raises(ReplyError, match="more than 4096 bytes"):
        rotator.position_deg()


def test_lost_link_ends_every_exchange(two, until):
    peer, polarizer, plate = two({MA_45: b""})
    polarizer.start_move(45)
    plate.start_move(90)
    until(lambda: peer.commands[-1] == MA_45)
    peer.vanish()
    with pytest.raises(NotConnectedError, match="is gone"):
        ended(polarizer, until)
    with pytest.raises(NotConnectedError, match="is gone"):
        plate.is_moving()
    plate.reconnect()
    assert [polarizer.position_deg(), plate.position_deg()] == [0.0, 0.0]
    assert peer.commands.count(MA_45) == 1


def test_port_opened_afresh_by_one_module_ends_the_motion_of_another(two, until):
    peer, polarizer, plate = two({MA_45: b""})
    polarizer.start_move(45)
    until(lambda: peer.commands[-1] == MA_45)
    plate.reconnect()
    with pytest.raises(NotConnectedError, match="the port was opened afresh before the module had answered"):
        polarizer.is_moving()


def test_axis_on_a_rotator_moves_and_arrives(rotator, clock, until):
    at_45 = [b"0PO00000000\r\n", b"0PO00004600\r\n"]
    _, rotator = rotator({MA_45: b"0PO00004600\r\n", b"0gp": at_45})
    axis = Axis(rotator, clock, Travel((0, 360), settle_s=0.1, tolerance_deg=0.1))
    axis.connect()
    clock.time_s += 1
    axis.start_homing()
    arrive(axis, clock)
    axis.start_move(45)
    clock.time_s += 0.2
    ended(axis, until)
    assert axis.position_deg() == 45.0


SLIDER = {
    b"3in": b"3IN091140028420211401006000000001\r\n",
    b"3i1": b"3I1100FFFFFFFFFFF00AC00A5\r\n",
    b"3gs": b"3GS00\r\n",
    b"3gp": b"3PO00000000\r\n",
    b"3st": b"3GS00\r\n",
}


@pytest.fixture
def slider(bus):
    def make(changes=None, slots=4):
        peer, wire = bus(SLIDER | (changes or {}))
        return peer, ElliptecSlider(wire, 3, name="analyzer", slots=slots, settle_s=0.05)

    return make


def test_slider_is_told_to_stop_over_a_fresh_connection(slider, until):
    peer, slider = slider()
    slider.connect()
    peer.vanish()
    until(lambda: bool(select.select([slider._module._bus._link], [], [], 0)[0]))
    slider.stop()
    assert (peer.connections, peer.commands[-1]) == (2, b"3st")
    assert not slider.is_moving()


def test_slider_steps_to_a_slot_one_step_after_the_other(slider, clock):
    changes = {b"3fw": [b"3PO00000020\r\n", b"3PO00000040\r\n", b"3GS00\r\n"]}
    peer, slider = slider(changes | {b"3gp": [b"3PO00000000\r\n", b"3PO0000005F\r\n"]})
    slider.connect()
    slider.start_select(4)
    assert slider.is_moving()
    arrive(slider, clock)
    assert peer.commands == [b"3in", b"3gs", b"3gp", b"3gs", b"3fw", b"3fw", b"3fw", b"3gp", b"3gs"]
    assert slider.slot() == 4


def test_slider_steps_back_and_not_at_all(slider, clock):
    peer, slider = slider({b"3gp": b"3PO00000020\r\n", b"3bw": b"3PO00000000\r\n"})
    slider.connect()
    slider.start_select(2)
    assert not slider.is_moving()
    slider.start_select(1)
    arrive(slider, clock)
    assert peer.commands == [b"3in", b"3gs", b"3gp", b"3gs", b"3gp", b"3gs", b"3bw"]


def test_step_that_leads_elsewhere_ends_the_steps(slider, clock):
    peer, slider = slider({b"3fw": b"3PO00000000\r\n"})
    slider.connect()
    slider.start_select(4)
    with pytest.raises(PositionError, match="analyzer: the slider was sent to slot 2 but stands at slot 1"):
        arrive(slider, clock)
    assert peer.commands.count(b"3fw") == 1


def test_step_that_fails_ends_the_steps(slider, clock):
    peer, slider = slider({b"3fw": b"3GS02\r\n"})
    slider.connect()
    slider.start_select(3)
    with pytest.raises(DeviceFaultError, match="analyzer: the module answers '3fw' with status 2, mechanical time-out"):
        arrive(slider, clock)
    assert peer.commands.count(b"3fw") == 1
    assert not slider.is_moving()


def test_stopped_slider_takes_no_further_step(slider, clock, until):
    peer, slider = slider({b"3fw": b""})
    slider.connect()
    clock.time_s += 1
    slider.start_select(4)
    clock.time_s += 1
    assert slider.is_moving()
    until(lambda: peer.commands[-1] == b"3fw")
    slider.stop()
    assert peer.commands[-1] == b"3st"
    peer._answers |= {b"3gs": [b"3GS09\r\n", b"3GS00\r\n"]}
    assert [slider.is_moving(), slider.is_moving()] == [True, False]
    assert peer.commands.count(b"3fw") == 1


@pytest.mark.parametrize("position", [b"00000010", b"FFFFFFE0", b"00000080", b"00000023", b"0000002F"])
def test_slider_between_slots_has_none(slider, position):
    peer, slider = slider({b"3gp": b"3PO" + position + b"\r\n"})
    slider.connect()
    assert slider.slot() is None
    with pytest.raises(PositionError, match="analyzer: the slider stands between its slots"):
        slider.start_select(1)
    assert peer.commands[-2:] == [b"3gp", b"3gs"]


def test_slider_that_its_button_has_moved_has_no_slot_on_the_way(slider):
    """It names the slot where it is going."""
    _, slider = slider({b"3gs": [b"3GS00\r\n", b"3GS09\r\n", b"3GS00\r\n"], b"3gp": b"3PO00000020\r\n"})
    slider.connect()
    assert [slider.slot(), slider.slot()] == [None, 2]


@pytest.mark.parametrize("position", [b"0000001E", b"00000020", b"00000022"])
def test_slot_is_where_it_should_be_or_very_near(slider, position):
    _, slider = slider({b"3gp": b"3PO" + position + b"\r\n"})
    slider.connect()
    assert slider.slot() == 2


@pytest.mark.parametrize("slot", [0, 5, -1])
def test_slot_that_does_not_exist_is_refused_before_the_first_byte(slider, slot):
    peer, slider = slider()
    with pytest.raises(LimitError, match=f"analyzer: slot {slot} does not exist"):
        slider.start_select(slot)
    slider.connect()
    assert peer.commands == [b"3in", b"3gs"]


def test_slider_with_other_slots_is_refused(slider):
    _, slider = slider(slots=2)
    with pytest.raises(DeviceFaultError, match="address 3 is of type 9, not a slider of 2 slots"):
        slider.connect()
