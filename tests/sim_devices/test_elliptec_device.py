"""The simulated Elliptec modules speak the protocol of their fact sheet."""

import random

import pytest
from numpy.testing import assert_allclose

from sim_devices.axis import Axis
from sim_devices.thorlabs_elliptec.bus import ThorlabsElliptec
from sim_devices.thorlabs_elliptec.rotator import ELL8, ELL18, STEP_DEG, ElliptecRotator
from sim_devices.thorlabs_elliptec.slider import ELL6, ELL9, ElliptecSlider
from sim_devices.wheel import Wheel

BYTE_S = 10 / 9600
TO_45_DEG = b"0ma00004600"


@pytest.fixture
def axis():
    return Axis(STEP_DEG)


@pytest.fixture
def ell14(axis):
    return ThorlabsElliptec(ElliptecRotator(axis, spread=0))


@pytest.fixture
def talk(converse, ell14):
    return converse(ell14)


@pytest.fixture
def wheel():
    return Wheel()


@pytest.fixture
def ell9(wheel):
    return ThorlabsElliptec(ElliptecSlider(wheel, ELL9), "3")


def text(heard):
    return b"".join(line for _, line in heard)


def answer(talk, sent, now_s, until_s=None):
    """What is said between the end of a packet and a second later, or `until_s`."""
    talk.hear(now_s)
    talk.send(sent, now_s)
    return text(talk.hear(now_s + 1.0 if until_s is None else until_s))


def position(line):
    """The pulses in a position line."""
    assert line[1:3] == b"PO"
    return int.from_bytes(bytes.fromhex(line[3:11].decode()), "big", signed=True)


ANSWERS = [
    (b"0in", b"0IN0E1140028420211401016800023000\r\n"),
    (b"0gs", b"0GS00\r\n"),
    (b"0gp", b"0PO00000000\r\n"),
    (b"0gv", b"0GV64\r\n"),
    (b"0sv320gv", b"0GS00\r\n0GV32\r\n"),
    (b"0sv65", b"0GS04\r\n"),
    (b"0sv3g", b"0GS03\r\n"),
    (b"0gj", b"0GJ00004600\r\n"),
    (b"0sjFFFFFFFE0gj", b"0GS00\r\n0GJFFFFFFFE\r\n"),
    (b"0so000001000go", b"0GS00\r\n0HO00000100\r\n"),
    (b"0go", b"0HO00000000\r\n"),
    (b"0i1", b"0I1110300FFFFFFFF00B8008D\r\n"),
    (b"0f280A00i2", b"0GS00\r\n0I2110300FFFFFFFF00A0008D\r\n"),
    (b"0b180A00i1", b"0GS00\r\n0I1110300FFFFFFFF00B800A0\r\n"),
    (b"0f18000", b"0GS04\r\n"),
    (b"0i3", b"0GS03\r\n"),
    (b"0st", b"0GS00\r\n"),
    (b"0us", b"0GS00\r\n"),
    (b"0caB0gsBgs", b"BGS00\r\nBGS00\r\n"),
    (b"0zz", b"0GS03\r\n"),
    # an error is kept until it is asked for
    (b"0zz0gs0gs", b"0GS03\r\n0GS03\r\n0GS00\r\n"),
    # other addresses, also with other commands' lengths
    (b"1gs", b""),
    (b"1ma000046000gs", b"0GS00\r\n"),
    (b"Fin0gs", b"0GS00\r\n"),
    # two digits for one, as some hosts send them, with the end of line that clears the second
    (b"0ca00\r0gs", b"0GS00\r\n0GS00\r\n"),
    # ends of line, and what they clear
    (b"0gs\r\n0gp\r\n", b"0GS00\r\n0PO00000000\r\n"),
    (b"0ma0000\r0gs", b"0GS00\r\n"),
    (b"0ma0000\n\r\n0gs", b"0GS00\r\n"),
    # noise before a packet
    (b"\xff\x00?0gs", b"0GS00\r\n"),
    (b"000gs", b"0GS00\r\n"),
    (b"0?0gs", b"0GS00\r\n"),
    (b"GS0gs", b"0GS00\r\n"),
]


@pytest.mark.parametrize(("sent", "answers"), ANSWERS)
@pytest.mark.parametrize("trailing", [b"", b"0m"])
@pytest.mark.parametrize("one_by_one", [False, True])
def test_packets_are_answered(talk, sent, answers, trailing, one_by_one):
    for data in [bytes([byte]) for byte in sent] if one_by_one else [sent + trailing]:
        talk.send(data)
    assert text(talk.hear(1.9)) == answers


def test_an_identity_is_33_characters(talk):
    assert len(answer(talk, b"0in", 0.0)) == 33 + 2


@pytest.mark.parametrize(
    ("mover", "identity"),
    [
        (lambda: ElliptecRotator(Axis(STEP_DEG), ELL18), b"IN1211400284202114010168000230"),
        (lambda: ElliptecRotator(Axis(360 / 262_144), ELL8), b"IN0811400284202114010168000400"),
        (lambda: ElliptecSlider(Wheel(), ELL9), b"IN0911400284202114"),
        (lambda: ElliptecSlider(Wheel(), ELL6), b"IN0611400284202114"),
    ],
)
def test_every_kind_says_what_it_is(converse, mover, identity):
    found = answer(converse(ThorlabsElliptec(mover(), "A")), b"Ain", 0.0)
    assert found.startswith(b"A" + identity)
    assert len(found) == 35


def test_a_reply_takes_the_time_of_its_characters(ell14):
    ((due_s, _),) = ell14.session().receive(b"0gs", 1.0)
    assert_allclose(due_s, 1.0 + (3 + 7) * BYTE_S + 0.002)


def test_a_move_is_silent_until_it_is_done(talk, axis):
    talk.send(TO_45_DEG, 0.0)
    ((due_s, line),) = talk.hear(5.0)
    assert line == b"0PO00004600\r\n"
    # 11 characters, 45/430 + 430/8600 s, rest, 13 characters
    assert_allclose(due_s, 11 * BYTE_S + 45 / 430 + 0.05 + 0.04 + 0.002 + 13 * BYTE_S, atol=1e-4)
    assert_allclose(axis.position_deg(5.0), 45.0)


@pytest.mark.parametrize(("way_deg", "about_s"), [(90, 0.3), (360, 0.95)])
def test_moves_last_as_long_as_real_ones(talk, way_deg, about_s):
    talk.send(b"0mr%08X" % round(way_deg / STEP_DEG), 0.0)
    ((due_s, _),) = talk.hear(5.0)
    assert_allclose(due_s, about_s, atol=0.06)


def test_half_the_velocity_takes_about_twice_the_time(talk):
    talk.send(TO_45_DEG, 0.0)
    ((full_s, _),) = talk.hear(5.0)
    talk.send(b"0sv32", 10.0)
    talk.hear(11.0)
    talk.send(b"0ma00000000", 20.0)
    ((half_s, _),) = talk.hear(25.0)
    # 45 deg at 430 and at 215 deg/s; half the velocity is reached in half the time
    assert_allclose((half_s - 20.0) - full_s, 45 / 430 - 0.025, atol=1e-4)


def test_relative_moves_and_jogs_count_from_here(talk):
    assert answer(talk, b"0mrFFFFEE80", 0.0) == b"0POFFFFEE80\r\n"
    assert answer(talk, b"0sj00000064", 2.0) == b"0GS00\r\n"
    assert answer(talk, b"0fw", 4.0) == b"0POFFFFEEE4\r\n"
    assert answer(talk, b"0bw", 6.0) == b"0POFFFFEE80\r\n"


def test_targets_are_missed_by_a_few_pulses_the_same_ones_every_time(converse):
    def misses(seed, spread=5):
        talk = converse(ThorlabsElliptec(ElliptecRotator(Axis(STEP_DEG), spread=spread, seed=seed)))
        targets = [1000 * (number % 7) for number in range(40)]
        found = [answer(talk, b"0ma%08X" % target, 5.0 * number) for number, target in enumerate(targets)]
        return [position(line) - target for line, target in zip(found, targets, strict=True)]

    one = misses(1)
    assert one == misses(1)
    assert one != misses(2)
    assert max(map(abs, one)) == 5
    assert misses(1, spread=0) == [0] * 40


def test_the_reported_position_is_the_true_one(converse, axis):
    talk = converse(ThorlabsElliptec(ElliptecRotator(axis, spread=20, seed=3)))
    reached = position(answer(talk, TO_45_DEG, 0.0))
    assert reached != 0x4600
    assert_allclose(axis.position_deg(5.0), reached * STEP_DEG)
    assert answer(talk, b"0gp", 6.0) == b"0PO%08X\r\n" % reached


def test_while_it_moves_it_is_busy_and_takes_no_other_motion(talk):
    talk.send(b"0mr00023000", 0.0)
    talk.hear(0.1)
    for motion in (b"0ho0", b"0ma00000000", b"0mr00000001", b"0fw", b"0bw", b"0om", b"0cm", b"0s1", b"0st", b"0gs"):
        talk.send(motion, 0.1)
    assert text(talk.hear(0.5)) == b"0GS09\r\n" * 10
    assert text(talk.hear(2.0)) == b"0PO00023000\r\n"
    assert answer(talk, b"0gs", 3.0) == b"0GS00\r\n"


def test_the_position_is_told_on_the_way(talk):
    talk.send(b"0mr00023000", 0.0)
    talk.send(b"0gp", 0.4)
    assert 0x5000 < position(text(talk.hear(0.5))) < 0x20000


@pytest.mark.parametrize(
    ("sent", "start", "home_deg", "after_s"), [(b"0ho0", 0x4600, 0, 0.2), (b"0ho1", 0x4600, 360, 1)]
)
def test_homing_turns_the_way_that_was_asked_and_counts_from_there(talk, axis, sent, start, home_deg, after_s):
    answer(talk, b"0ma%08X" % start, 0.0)
    talk.send(sent, 2.0)
    ((due_s, line),) = talk.hear(5.0)
    assert line == b"0PO00000000\r\n"
    assert_allclose(due_s - 2.0, after_s, atol=0.2)
    assert due_s - 2.0 < 1.5
    assert_allclose(axis.position_deg(5.0), home_deg, atol=1e-9)


@pytest.mark.parametrize("sent", [b"0ho0", b"0ho0\r\n", b"0ho00\r", b"0ho01\r\n"])
def test_homing_is_told_with_one_digit_or_two(talk, sent):
    assert answer(talk, sent, 0.0) == b"0PO00000000\r\n"
    assert text(talk.hear(9.0)) == b""


def test_near_its_mark_it_homes_without_a_turn(converse, axis):
    talk = converse(ThorlabsElliptec(ElliptecRotator(axis, seed=4)))
    for second in range(0, 40, 2):
        reached = answer(talk, b"0ho%d" % (second // 2 % 2), float(second))
        assert abs(position(reached)) <= 5
        assert abs(axis.position_deg(second + 1.0)) < 0.02


def test_the_home_offset_moves_the_zero(talk, axis):
    answer(talk, b"0so00001000", 0.0)
    assert answer(talk, b"0ho1", 2.0) == b"0PO00000000\r\n"
    assert_allclose(axis.position_deg(4.0), 0x1000 * STEP_DEG)
    assert answer(talk, b"0ma00001000", 5.0) == b"0PO00001000\r\n"
    assert_allclose(axis.position_deg(7.0), 0x2000 * STEP_DEG)


@pytest.mark.parametrize("sent", [b"0ma7FFFFFFF", b"0ma80000000", b"0sv00" + TO_45_DEG])
def test_a_motor_that_runs_too_long_is_stopped(talk, axis, sent):
    talk.send(sent, 0.0)
    heard = talk.hear(10.0)
    assert_allclose(heard[-1][0], 2.0, atol=0.15)
    assert heard[-1][1] == b"0GS02\r\n"
    assert answer(talk, b"0gs", 10.0) == b"0GS02\r\n"
    assert answer(talk, b"0gs", 12.0) == b"0GS00\r\n"
    assert abs(axis.position_deg(10.0)) < 900
    assert not axis.is_moving(10.0)


def test_an_error_is_kept_also_when_nobody_hears_of_it(converse, ell14):
    ell14.session().receive(b"0ma7FFFFFFF", 0.0)
    assert answer(converse(ell14), b"0gs", 5.0) == b"0GS02\r\n"


def test_a_jog_of_zero_turns_until_it_is_stopped(talk, axis):
    answer(talk, b"0sj00000000", 0.0)
    assert answer(talk, b"0bw", 2.0, until_s=9.0) == b"0GS00\r\n"
    assert answer(talk, b"0gs", 9.0) == b"0GS09\r\n"
    assert axis.position_deg(12.0) < -4000
    reached = answer(talk, b"0st", 12.0)
    assert_allclose(position(reached) * STEP_DEG, axis.position_deg(20.0), atol=STEP_DEG)
    assert answer(talk, b"0gs", 20.0) == b"0GS00\r\n"


@pytest.mark.parametrize(("sent", "lasts_s"), [(b"0om", 60.0), (b"0cm", 120.0)])
def test_cleaning_is_told_at_its_beginning_and_at_its_end(talk, sent, lasts_s):
    assert answer(talk, sent, 0.0, until_s=lasts_s - 1) == b"0GS09\r\n"
    assert text(talk.hear(lasts_s + 1)) == b"0GS00\r\n"


def test_cleaning_can_be_stopped(talk):
    answer(talk, b"0cm", 0.0)
    assert answer(talk, b"0st", 5.0, until_s=500.0) == b"0GS00\r\n"
    assert answer(talk, TO_45_DEG, 500.0) == b"0PO00004600\r\n"


def test_a_frequency_search_takes_seconds(talk):
    assert answer(talk, b"0s1", 0.0, until_s=2.9) == b""
    assert text(talk.hear(4.0)) == b"0GS00\r\n"


def test_an_unfinished_packet_is_dropped_after_two_seconds(talk):
    talk.send(b"0ma0000", 0.0)
    assert talk.hear(1.9) == []
    assert text(talk.hear(2.1)) == b"0GS01\r\n"
    assert answer(talk, b"4600", 3.0) == b""
    # the 0 at its end begins another one, which the next packet completes
    assert answer(talk, b"0gs", 3.1, until_s=3.5) == b"0GS01\r\n"


def test_a_slow_typist_is_understood(talk):
    for number, character in enumerate(b"0gs"):
        talk.send(bytes([character]), 1.9 * number)
    assert text(talk.hear(9.0)) == b"0GS00\r\n"


def test_an_unfinished_packet_for_another_is_dropped_in_silence(talk):
    talk.send(b"1ma0000", 0.0)
    assert text(talk.hear(9.0)) == b""
    assert answer(talk, b"0gs", 9.0) == b"0GS00\r\n"


def test_an_isolated_module_is_silent_for_its_minutes(talk):
    assert answer(talk, b"0is02", 0.0) == b"0GS00\r\n"
    assert answer(talk, b"0gs", 119.0) == b""
    assert answer(talk, b"0gs", 121.0) == b"0GS00\r\n"


def test_a_group_address_is_heard_once(talk):
    assert answer(talk, b"0ga9", 0.0) == b"0GS00\r\n"
    assert answer(talk, b"9ma00004600", 2.0) == b"0PO00004600\r\n"
    assert answer(talk, b"9gs", 4.0) == b""
    assert answer(talk, b"0gs", 6.0) == b"0GS00\r\n"


def test_an_address_is_kept_through_power_off_when_it_was_saved(ell14, talk):
    answer(talk, b"0ca5", 0.0)
    ell14.power_cycle(1.5)
    assert answer(talk, b"0gs5gs", 2.0) == b"0GS00\r\n"
    answer(talk, b"0ca55f180A05us", 4.0)
    answer(talk, b"5f28077", 6.0)
    ell14.power_cycle(8.0)
    assert answer(talk, b"0gs5i15i2", 9.0) == b"5I1110300FFFFFFFF00A0008D\r\n5I2110300FFFFFFFF00B8008D\r\n"


def test_a_power_cycle_ends_a_motion_and_loses_the_count(ell14, talk, axis):
    talk.send(b"0mr00023000", 0.0)
    ell14.power_cycle(0.4)
    assert text(talk.hear(5.0)) == b""
    assert 20 < axis.position_deg(5.0) < 300
    assert answer(talk, b"0gp", 6.0) == b"0PO00000000\r\n"


@pytest.mark.parametrize(
    ("commands", "reached"),
    [
        ([b"fw", b"fw", b"fw", b"fw"], [0x20, 0x40, 0x60, 0x60]),
        ([b"fw", b"bw", b"bw"], [0x20, 0, 0]),
        ([b"ma00000060", b"bw", b"ho0"], [0x60, 0x40, 0]),
    ],
)
def test_a_slider_goes_from_slot_to_slot(converse, ell9, wheel, commands, reached):
    talk = converse(ell9)
    for number, (command, pulses) in enumerate(zip(commands, reached, strict=True)):
        now_s = 5.0 * number
        assert answer(talk, b"3" + command, now_s, now_s + 2.5) == b"3PO%08X\r\n" % pulses
        assert wheel.slot(now_s + 2.5) == pulses // 0x20 + 1


def test_a_slider_takes_its_time_and_never_the_way_round(converse, ell9, wheel):
    talk = converse(ell9)
    talk.send(b"3ma00000060", 0.0)
    ((due_s, _),) = talk.hear(5.0)
    assert_allclose(due_s, 1.8, atol=0.03)
    assert wheel.slot(1.0) is None


@pytest.mark.parametrize(("command", "status"), [(b"ma00000021", 4), (b"ma00000080", 4), (b"maFFFFFFE0", 4)])
def test_a_slider_has_no_other_places(converse, ell9, command, status):
    assert answer(converse(ell9), b"3" + command, 0.0) == b"3GS%02X\r\n" % status


@pytest.mark.parametrize("command", [b"mr00000020", b"gj", b"sj00000001", b"go", b"so00000000"])
def test_a_slider_knows_no_distances(converse, ell9, command):
    assert answer(converse(ell9), b"3" + command, 0.0) == b"3GS03\r\n"


def test_a_two_position_slider_has_one_motor(converse):
    talk = converse(ThorlabsElliptec(ElliptecSlider(Wheel(), ELL6), "2"))
    assert answer(talk, b"2fw2fw2i2", 0.0) == b"2GS09\r\n2GS03\r\n2PO00000020\r\n"


def test_a_button_is_told_unasked_at_once_and_at_the_end_of_its_motion(converse, ell9, wheel):
    talk, told = converse(ell9), []
    ell9.tell = lambda time_s, line: told.append((time_s, line))
    ell9.press(1.0)
    assert wheel.slot(2.0) == 2
    assert told == [(1.0, b"3BS00\r\n"), (1.6, b"3BO00000020\r\n")]
    assert answer(talk, b"3gs", 1.1) == b"3GS09\r\n"
    # while it moves, and while it is isolated, there is nothing to tell
    ell9.press(1.2)
    assert len(told) == 2
    answer(talk, b"3is01", 3.0)
    ell9.press(5.0)
    assert (len(told), wheel.slot(6.0)) == (2, 3)


def test_an_ell8_has_pulses_of_its_own(converse):
    axis = Axis(360 / 262_144)
    talk = converse(ThorlabsElliptec(ElliptecRotator(axis, ELL8, spread=0)))
    assert position(answer(talk, b"0ma00010000", 0.0)) == 65_536
    assert_allclose(axis.motor_deg(1.0), 90.0)


@pytest.mark.parametrize("home", [b"0ho0", b"0ho1", b"0ho00\r", b"0ho01\r\n", b"0ho1\n"])
def test_a_host_may_send_one_digit_or_two_and_any_end_of_line(talk, home):
    answer(talk, TO_45_DEG, 0.0)
    assert answer(talk, home, 2.0, 4.0) == b"0PO00000000\r\n"
    assert answer(talk, b"0gs", 5.0) == b"0GS00\r\n"


@pytest.mark.parametrize("address", ["", "G", "a", "01"])
def test_an_address_is_one_digit(address):
    with pytest.raises(ValueError, match="address of a module"):
        ThorlabsElliptec(ElliptecSlider(Wheel()), address)


def test_noise_neither_stops_a_module_nor_fills_its_memory(ell14):
    source = random.Random(1)
    good = [b"0in", b"0gs", TO_45_DEG, b"0mrFFFFEE80", b"0ho0", b"0sv64", b"0i1", b"0is00", b"0fw\r\n", b"0om", b"0st"]
    session, now_s = ell14.session(), 0.0
    for _ in range(20_000):
        packet = bytearray(source.choice(good))
        for _ in range(source.randrange(3)):
            packet[source.randrange(len(packet))] = source.randrange(256)
        session.receive(bytes(packet[: source.randrange(len(packet)) + 1]), now_s)
        now_s += 0.02
    assert len(session._reader.unfinished) < 12
