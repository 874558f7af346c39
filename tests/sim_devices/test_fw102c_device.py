"""The simulated filter wheel echoes, prompts and turns as its fact sheet says."""

import pytest
from numpy.testing import assert_allclose

from sim_devices.thorlabs_fw102c import ThorlabsFw102c
from sim_devices.wheel import Wheel


@pytest.fixture
def wheel():
    return Wheel()


@pytest.fixture
def device(wheel):
    """A wheel whose line takes no time."""
    return ThorlabsFw102c(wheel, range(1, 7), baudrates=(10**15, 10**15))


class Told:
    """A session with all that it will say, as if the times of it had come."""

    def __init__(self, session):
        self._session = session

    def receive(self, data, now_s=0.0):
        return [
            (due_s, text) if isinstance(text, bytes) else text(due_s)[0]
            for due_s, text in self._session.receive(data, now_s)
        ]


@pytest.fixture
def fw(device):
    return Told(device.session())


UNKNOWN, INVALID = b"Command error CMD_NOT_DEFINED\r", b"Command error CMD_ARG_INVALID\r"


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"*idn?\r", b"*idn?\rTHORLABS FW102C/FW212C Filter Wheel version 1.07\r> "),
        (b"pos?\r", b"pos?\r1\r> "),
        (b"pcount?\r", b"pcount?\r6\r> "),
        (b"speed?\r", b"speed?\r1\r> "),
        (b"speed=0\rspeed?\r", b"speed=0\r> speed?\r0\r> "),
        (b"speed=1\r", b"speed=1\r> "),
        (b"trig=1\rtrig?\r", b"trig=1\r> trig?\r1\r> "),
        (b"sensors=1\rsensors?\r", b"sensors=1\r> sensors?\r1\r> "),
        (b"baud=0\rbaud?\r", b"baud=0\r> baud?\r0\r> "),
        (b"pcount=12\rpcount?\r", b"pcount=12\r> pcount?\r12\r> "),
        (b"save\r", b"save\r> "),
        (b"foo\r", b"foo\r" + UNKNOWN + b"> "),
        (b"POS?\r", b"POS?\r" + UNKNOWN + b"> "),
        (b"pos ?\r", b"pos ?\r" + UNKNOWN + b"> "),
        (b"\r", b"\r" + UNKNOWN + b"> "),
        (b"\0\0pos?\r\n", b"pos?\r1\r> "),
        (b"pos=7\r", b"pos=7\r" + INVALID + b"> "),
        (b"pos=0\r", b"pos=0\r" + INVALID + b"> "),
        (b"pos=\r", b"pos=\r" + INVALID + b"> "),
        (b"pos=two\r", b"pos=two\r" + INVALID + b"> "),
        (b"pos=-1\r", b"pos=-1\r" + INVALID + b"> "),
        (b"pcount=8\r", b"pcount=8\r" + INVALID + b"> "),
        (b"speed=2\r", b"speed=2\r" + INVALID + b"> "),
        (b"pos=3\rpos?\r", b"pos=3\r> pos?\r3\r> "),
        (b"\x1b[Apos?\r", b"pos?\r2\r> "),
        (b"\x1b[Bpos?\r", b"pos?\r6\r> "),
        (b"\x1bxpos?\r", b"pos?\r1\r> "),
    ],
)
def test_commands_are_echoed_answered_and_prompted(fw, feed, command, answer):
    trailing = b"" if command.startswith(b"\x1b") else b"po"
    replied = b"".join(text for _, text in feed(fw, command, trailing=trailing))
    assert replied in (answer, answer + trailing)


def test_characters_are_echoed_before_the_command_ends(fw):
    ((due_s, text),) = fw.receive(b"po", 1.0)
    assert (due_s, text) == (pytest.approx(1.0), b"po")


@pytest.mark.parametrize(("slot", "steps"), [(1, 0), (2, 1), (3, 2), (4, 3), (5, 2), (6, 1)])
@pytest.mark.parametrize(("speed", "slot_s"), [(1, 0.5), (0, 2.0)])
def test_the_echo_comes_at_once_and_the_prompt_on_arrival(fw, wheel, slot, steps, speed, slot_s):
    fw.receive(b"speed=%d\r" % speed, 0.0)
    replies = fw.receive(b"pos=%d\r" % slot, 10.0)
    assert_allclose(replies[0][0], 10.0)
    assert_allclose(replies[-1][0], 10.0 + steps * slot_s)
    assert b"".join(text for _, text in replies) == b"pos=%d\r> " % slot
    assert wheel.slot(10.001 + steps * slot_s) == slot
    assert steps == 0 or wheel.slot(10.0 + steps * slot_s - 0.01) is None


def test_what_arrives_during_a_turn_is_taken_on_arrival(device, fw, wheel):
    fw.receive(b"pos=3\r", 0.0)
    ((due_s, text),) = device.session().receive(b"pos?\r", 0.4)
    assert (due_s, text) == (pytest.approx(1.0), b"pos?\r3\r> ")
    (echoed_s, echo), (arrived_s, prompt) = fw.receive(b"pos=5\r", 0.5)
    assert (echoed_s, echo, arrived_s, prompt) == (pytest.approx(1.0), b"pos=5\r", pytest.approx(2.0), b"> ")
    assert [wheel.slot(time_s) for time_s in (0.9, 1.9, 2.001)] == [None, None, 5]


@pytest.mark.parametrize(("baud", "baudrate"), [(b"0", 9600), (b"1", 115_200)])
def test_characters_take_the_time_of_the_line(wheel, baud, baudrate):
    fw = Told(ThorlabsFw102c(wheel, range(1, 7)).session())
    fw.receive(b"baud=" + baud + b"\r", 0.0)
    ((due_s, text),) = fw.receive(b"pos?\r", 1.0)
    assert_allclose(due_s, 1.0 + (5 + len(text)) * 10 / baudrate)


def test_without_power_it_keeps_what_was_saved_and_where_it_stands(device, ask, wheel):
    fw = Told(device.session())
    ask(fw, b"speed=0\rtrig=1\rsave\rsensors=1\rtrig=0\rspeed=1\rpos=3\rpo")
    device.power_cycle(10.0)
    assert ask(fw, b"speed?\rtrig?\rsensors?\rpos?\r", 11.0) == (b"speed?\r0\r> trig?\r1\r> sensors?\r0\r> pos?\r3\r> ")


def test_a_twelve_slot_wheel_turns_the_shorter_way(ask):
    fw = Told(ThorlabsFw102c(Wheel(), range(1, 13)).session())
    assert_allclose(fw.receive(b"pos=11\r", 0.0)[-1][0], 1.0, atol=0.001)
    assert ask(fw, b"pcount=6\r", 5.0) == b"pcount=6\r" + INVALID + b"> "


def test_a_client_finds_what_another_one_left_half_typed(device, ask):
    ask(device.session(), b"pos=")
    assert ask(device.session(), b"4\rpos?\r") == b"4\r> pos?\r4\r> "


@pytest.mark.parametrize("typed", [b"pos=4", b"pos=1", b"pos=", b"po", b"pos?", b"", b"\x1b", b"\x1b["])
def test_text_behind_a_half_typed_command_keeps_the_wheel_where_it_is(device, ask, typed):
    ask(device.session(), typed)
    assert b"Command error" in ask(device.session(), b"999!1\r")
    assert ask(device.session(), b"pos?\r") == b"pos?\r1\r> "


def test_a_command_without_end_fills_no_memory(device, fw, ask):
    for _ in range(100):
        ask(fw, b"x" * 1000)
    assert len(device._typed) < 100
    assert ask(fw, b"\r") == b"\r" + UNKNOWN + b"> "
