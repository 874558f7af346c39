"""Several devices share one line."""

import pytest

from sim_devices.axis import Axis
from sim_devices.serving.shared_line import SharedLine
from sim_devices.thorlabs_elliptec.bus import ThorlabsElliptec
from sim_devices.thorlabs_elliptec.rotator import STEP_DEG, ElliptecRotator
from sim_devices.thorlabs_elliptec.slider import ElliptecSlider
from sim_devices.wheel import Wheel


@pytest.fixture
def axes():
    return Axis(STEP_DEG), Axis(STEP_DEG)


@pytest.fixture
def line(axes):
    """Rotators at 0 and 2, a slider at 5."""
    first, second = (ElliptecRotator(axis, spread=0) for axis in axes)
    modules = [
        ThorlabsElliptec(first, "0"),
        ThorlabsElliptec(second, "2"),
        ThorlabsElliptec(ElliptecSlider(Wheel()), "5"),
    ]
    return SharedLine(modules)


@pytest.fixture
def talk(converse, line):
    return converse(line)


def lines(heard):
    return [line for _, line in heard]


def test_only_who_is_called_answers(talk):
    talk.send(b"".join(b"%Xgs" % address for address in range(16)))
    assert lines(talk.hear(1.0)) == [b"0GS00\r\n", b"2GS00\r\n", b"5GS00\r\n"]


def test_everyone_hears_every_byte(talk, axes):
    for byte in b"0ma0000460025in":
        talk.send(bytes([byte]))
    (identity, position) = lines(talk.hear(1.0))
    assert identity.startswith(b"5IN09")
    assert position == b"0PO00004600\r\n"


def test_what_is_said_comes_in_the_order_of_its_times(line, talk):
    talk.send(b"0mr000230005fw2mr00000100")
    heard = talk.hear(5.0)
    assert [line[:1] for line in lines(heard)] == [b"2", b"5", b"0"]
    times_s = [due_s for due_s, _ in line.session().receive(b"5gp2gp0gp", 9.0)]
    assert times_s == sorted(times_s)


def test_a_group_moves_together_and_everyone_tells_of_himself(talk, axes):
    talk.send(b"0gaA2gaA")
    assert lines(talk.hear(1.0)) == [b"0GS00\r\n", b"2GS00\r\n"]
    talk.send(b"Ama00004600", 1.0)
    first, second = talk.hear(2.0)
    assert (first[1], second[1]) == (b"0PO00004600\r\n", b"2PO00004600\r\n")
    assert axes[0].end_s == axes[1].end_s


def test_a_member_answers_at_its_new_address(talk):
    talk.send(b"2ca7")
    talk.send(b"2gs7gs", 1.0)
    assert lines(talk.hear(2.0)) == [b"7GS00\r\n", b"7GS00\r\n"]
