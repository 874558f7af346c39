from __future__ import annotations

import pytest

from drivers.thorlabs_fw102c import Exchange, ThorlabsFw102c, parse_exchange
from drivers.wire.link import take_frame
from goniometer.errors import DeviceFaultError, LimitError, PositionError, ReplyError, ReplyTimeoutError

IDENTITY = b"*idn?\rTHORLABS FW102C/FW212C Filter Wheel version 1.07\r> "
MARKS = [b"999!1\rCommand error CMD_NOT_DEFINED\r> ", b"999!2\rCommand error CMD_NOT_DEFINED\r> "]
ANSWERS = {
    b"999!1": MARKS[0],
    b"999!2": MARKS[1],
    b"*idn?": IDENTITY,
    b"pcount?": b"pcount?\r6\r> ",
    b"sensors=0": b"sensors=0\r> ",
    b"pos?": b"pos?\r3\r> ",
}

EXCHANGES = [
    (b"pos?\r3\r> ", Exchange("pos?", "3")),
    (b"speed=1\r> ", Exchange("speed=1", "")),
    (b"foo\rCommand error CMD_NOT_DEFINED\n> ", Exchange("foo", "Command error CMD_NOT_DEFINED")),
    (b"foo\rCommand error CMD_NOT_DEFINED\r> ", Exchange("foo", "Command error CMD_NOT_DEFINED")),
    (b"\x00\x00\x00\rCommand error CMD_NOT_DEFINED\r> ", Exchange("", "Command error CMD_NOT_DEFINED")),
    (IDENTITY, Exchange("*idn?", "THORLABS FW102C/FW212C Filter Wheel version 1.07")),
]


@pytest.mark.parametrize(("sent", "exchange"), EXCHANGES)
@pytest.mark.parametrize("trailing", [b"", b"pos?\r4\r> "])
def test_exchange_fed_whole(sent, exchange, trailing):
    received = bytearray(sent + trailing)
    assert parse_exchange(take_frame(received, b"> ")) == exchange
    assert received == trailing


@pytest.mark.parametrize(("sent", "exchange"), EXCHANGES)
def test_exchange_fed_byte_by_byte(sent, exchange):
    received = bytearray()
    frames = []
    for byte in sent:
        received.append(byte)
        frames.append(take_frame(received, b"> "))
    assert frames[:-1] == [None] * (len(sent) - 1)
    assert parse_exchange(frames[-1]) == exchange


@pytest.fixture
def wheel(make_peer, open_link, clock):
    def make(reply_timeout_s=2.0, changes=None):
        peer = make_peer(ANSWERS | (changes or {}))
        link = open_link(peer.port, "analyzer", reply_timeout_s)
        return peer, ThorlabsFw102c(link, clock, name="analyzer", slots=6, slot_s=0.5, settle_s=0.05)

    return make


def test_connects_without_moving(wheel):
    peer, wheel = wheel()
    wheel.connect()
    assert peer.commands == [b"999!1", b"*idn?", b"pcount?", b"sensors=0"]


@pytest.mark.parametrize("typed", [b"pos=4", b"pos=1", b"pos=", b"po", b"\x1b["])
def test_connecting_does_not_end_what_another_program_left_half_typed(make_peer, open_link, clock, typed):
    refused = b"999!1\rCommand error CMD_ARG_INVALID\r> "
    peer = make_peer(ANSWERS | {typed + b"999!1": refused})
    link = open_link(peer.port, "analyzer")
    link.write(typed)
    ThorlabsFw102c(link, clock, name="analyzer", slots=6, slot_s=0.5, settle_s=0.05).connect()
    assert peer.commands == [typed + b"999!1", b"*idn?", b"pcount?", b"sensors=0"]


def test_connects_through_zero_bytes_and_the_answers_of_an_earlier_user(wheel):
    _, wheel = wheel(changes={b"999!1": b"\x00\x00pos=3\r> \x00" + MARKS[0]})
    wheel.connect()
    assert wheel.slot() == 3


def test_port_opened_afresh_in_a_motion_forgets_it(wheel, until):
    peer, wheel = wheel(changes={b"pos=4": b"pos=4\r"})
    wheel.start_select(4)
    until(lambda: peer.commands == [b"pos=4"])
    wheel.reconnect()
    assert not wheel.is_moving()
    assert wheel.connect() == ()
    assert wheel.slot() == 3
    assert peer.commands == [b"pos=4", b"999!1", b"*idn?", b"pcount?", b"sensors=0", b"pos?"]


def test_wheel_with_other_slots_is_refused(wheel):
    _, wheel = wheel(changes={b"pcount?": b"pcount?\r12\r> "})
    with pytest.raises(DeviceFaultError, match="analyzer: the wheel is set up for 12 slots, the rig file for 6"):
        wheel.connect()


@pytest.mark.usefixtures("no_real_grace")
def test_silent_wheel_is_not_waited_for_without_end(wheel):
    _, silent = wheel(changes={b"999!1": b""})
    with pytest.raises(ReplyTimeoutError, match="analyzer: no prompt from the wheel"):
        silent.connect()


def test_other_device_on_the_port_is_refused(wheel):
    _, other = wheel(changes={b"*idn?": b"*idn?\rSOMETHING ELSE\r> "})
    with pytest.raises(ReplyError, match="not the identity of a Thorlabs filter wheel"):
        other.connect()


def test_selecting_returns_at_once_and_ends_with_the_prompt(wheel, until):
    peer, wheel = wheel(changes={b"pos=3": b"pos=3\r"})
    wheel.start_select(3)
    until(lambda: peer.commands == [b"pos=3"])
    assert wheel.is_moving()
    peer.say(b"> ")
    until(lambda: not wheel.is_moving())
    assert peer.commands == [b"pos=3", b"pos?"]
    assert not wheel.is_moving()


def test_wheel_that_stops_elsewhere_is_a_position_error(wheel, until):
    _, wheel = wheel(changes={b"pos=4": b"pos=4\r> "})
    wheel.start_select(4)
    with pytest.raises(PositionError, match="analyzer: the wheel was sent to slot 4 but stands at slot 3"):
        until(lambda: not wheel.is_moving())


def test_refused_command_is_a_fault(wheel, until):
    _, wheel = wheel(changes={b"pos=4": b"pos=4\rCommand error CMD_ARG_INVALID\r> "})
    wheel.start_select(4)
    with pytest.raises(DeviceFaultError, match="the wheel refused 'pos=4': Command error CMD_ARG_INVALID"):
        until(lambda: not wheel.is_moving())


@pytest.mark.parametrize("answer", [b"pos=3\r4\r> ", b"> ", b"\xff\xfe> ", b"pos=3\r\r> > "])
def test_after_a_motion_with_garbage_behind_it_the_wheel_is_asked_where_it_stands(wheel, until, answer):
    peer, wheel = wheel(changes={b"pos=3": answer, b"pos=4": answer})
    wheel.start_select(3)
    until(lambda: not wheel.is_moving())
    assert peer.commands[-1] == b"pos?"
    wheel.start_select(4)
    with pytest.raises(PositionError, match="was sent to slot 4 but stands at slot 3"):
        until(lambda: not wheel.is_moving())


@pytest.mark.parametrize("slot", [0, 7, -1])
def test_slot_that_does_not_exist_is_refused_before_the_first_byte(wheel, slot):
    peer, wheel = wheel()
    with pytest.raises(LimitError, match=f"analyzer: slot {slot} does not exist"):
        wheel.start_select(slot)
    assert wheel.slot() == 3
    assert peer.commands == [b"pos?"]


@pytest.mark.usefixtures("no_real_grace")
def test_motion_has_one_second_and_four_a_slot(wheel, clock):
    _, wheel = wheel(changes={b"pos=4": b"pos=4\r"})
    wheel.start_select(4)
    clock.time_s = 13 - 1e-6
    assert wheel.is_moving()
    clock.time_s = 13 + 1e-6
    with pytest.raises(ReplyTimeoutError, match=r"within 13 s.* Not done: slot 4 was not reached"):
        wheel.is_moving()


@pytest.mark.usefixtures("no_real_grace")
def test_prompt_that_came_while_the_host_hung_is_good(clock):
    class PromptHasCome:
        def write(self, data):
            pass

        def poll_until(self, terminator):
            return b"pos=3\r"

        def read_until(self, terminator):
            return b"pos?\r3\r"

        def until_answered(self, exchange):
            return exchange()

    wheel = ThorlabsFw102c(PromptHasCome(), clock, name="analyzer", slots=6, slot_s=0.5, settle_s=0.05)
    wheel.start_select(3)
    clock.time_s = 1e6
    assert not wheel.is_moving()


def test_stop_sends_nothing_and_the_next_question_drops_the_answer_of_the_motion(wheel):
    peer, wheel = wheel(changes={b"pos=4": b"pos=4\r", b"999!1": b"> " + MARKS[0]})
    wheel.start_select(4)
    wheel.stop()
    wheel.stop()
    assert not wheel.is_moving()
    assert wheel.slot() == 3
    assert peer.commands == [b"pos=4", b"999!1", b"pos?"]


@pytest.mark.parametrize("answer", [b"pos?\r> ", b"pos?\rx\r> ", b"3\r> ", b"pcount?\r6\r> ", b"\xff\xfe> "])
def test_garbage_is_refused(wheel, answer):
    _, wheel = wheel(changes={b"pos?": answer})
    with pytest.raises(ReplyError, match=r"analyzer: the answer to 'pos\?' is"):
        wheel.slot()


def test_wheel_that_never_ends_its_answer_is_refused(wheel):
    _, wheel = wheel(changes={b"pos?": b"x" * 10_000})
    with pytest.raises(ReplyError, match="more than 4096 bytes"):
        wheel.slot()


def test_question_that_was_not_answered_is_asked_again_and_late_answers_are_dropped(wheel):
    _, wheel = wheel(
        reply_timeout_s=0.05, changes={b"pos?": [b"pos?\r", b"pos?\r5\r> "], b"999!1": b"2\r> " + MARKS[0]}
    )
    assert wheel.slot() == 5


@pytest.mark.usefixtures("no_real_grace")
def test_late_mark_does_not_put_answers_one_question_behind(wheel):
    changes = {b"pos?": [b"", b"pos?\r5\r> "], b"999!1": b"", b"999!2": b"pos?\r2\r> " + MARKS[0] + MARKS[1]}
    peer, wheel = wheel(reply_timeout_s=0.05, changes=changes)
    assert [wheel.slot(), wheel.slot()] == [5, 5]
    assert peer.commands[:3] == [b"pos?", b"999!1", b"999!2"]


@pytest.mark.parametrize("garbage", [b"pos?\rx\r> ", b"pcount?\r6\r> "])
def test_answer_that_is_none_is_proof_of_nothing(wheel, garbage):
    peer, wheel = wheel(changes={b"pos?": [garbage, b"pos?\r5\r> "]})
    assert wheel.slot() == 5
    assert peer.commands == [b"pos?", b"999!1", b"pos?"]
