"""The simulated SR830 understands its commands, settles as its filter does, and remembers what went wrong."""

import math
import random

import pytest
from numpy.testing import assert_allclose

from sim_devices.stanford_sr830.instrument import StanfordSr830
from sim_devices.stanford_sr830.low_pass import LowPass

FULL_W = 1e-6
VOLTS_PER_WATT = 1e5
INPUT_OVERLOAD, OUTPUT_OVERLOAD, UNLOCKED, RANGE_CHANGE = 1, 4, 8, 16


class SteppedLight:
    """Chopped light of one power from the beginning of time, and of others from later on.

    `dark_w` is there while the chopper is closed, too; `density_w` is the noise's one-sided density in W/sqrt(Hz).
    """

    def __init__(self, power_w=FULL_W, *steps, dark_w=0.0, density_w=0.0):
        self.steps = [(-math.inf, power_w), *steps]
        self.dark_w, self.density_w = dark_w, density_w
        self._random = random.Random(3)

    def open_w(self, time_s, exposure_s):
        return [power_w for start_s, power_w in self.steps if start_s <= time_s + exposure_s / 2][-1] + self.dark_w

    def closed_w(self, time_s, exposure_s):
        return self.dark_w

    def noise_w(self, time_s, exposure_s):
        # the mean over T has the noise bandwidth 1 / 2T
        return self._random.gauss(0.0, self.density_w / math.sqrt(2 * exposure_s)) if self.density_w else 0.0


def made(light=None, **how):
    return StanfordSr830(light or SteppedLight(), **({"volts_per_watt": VOLTS_PER_WATT} | how))


@pytest.fixture
def lockin(ask):
    """A session of a lock-in that is locked to its chopper, with its status read, at 10 s."""
    session = made().session()
    ask(session, b"FMOD 0\r", 0.0)
    ask(session, b"*CLS\r", 1.0)
    return session


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"*IDN?\r", b"Stanford_Research_Systems,SR830,s/n12345,ver1.07\r"),
        (b"*idn?\n", b"Stanford_Research_Systems,SR830,s/n12345,ver1.07\r"),
        (b"\r\n * I D N ? \r\n", b"Stanford_Research_Systems,SR830,s/n12345,ver1.07\r"),
        (b"*ESR?\r", b"128\r"),
        (b"*CLS\r*ESR?\r", b"0\r"),
        (b"*ESR? 7\r*ESR? 7\r*ESR?\r", b"1\r0\r0\r"),
        (b"*STB?\r", b"2\r"),
        (b"LIAS?\r", b"0\r"),
        (b"SENS?\r", b"26\r"),
        (b"SENS 17;SENS?\r", b"17\r"),
        (b"sens17;Sens ?\r", b"17\r"),
        (b"OFLT?;OFSL?\r", b"8\r1\r"),
        (b"OFLT 10; OFSL 3; OFLT?; OFSL?;\r", b"10\r3\r"),
        (b"FMOD?;RSLP?;ISRC?;IGND?;ICPL?;ILIN?;RMOD?;SYNC?\r", b"1\r0\r0\r0\r0\r0\r1\r0\r"),
        (b"RSLP 2;ISRC 3;IGND 1;ICPL 1;ILIN 3;RMOD 2;SYNC 1;RSLP?;ISRC?;IGND?;ICPL?;ILIN?;RMOD?;SYNC?\r", None),
        (b"FREQ?\r", b"1000\r"),
        (b"FREQ 12345.6789\rFREQ?\r", b"12345.7\r"),
        (b"FREQ1.73000e+02\rFREQ?\r", b"173\r"),
        (b"FMOD 0\rFREQ?\r", b"0\r"),
        (b"PHAS 541;PHAS?\r", b"-179\r"),
        (b"PHAS -180;PHAS?\r", b"180\r"),
        (b"SLVL 0.0051;SLVL?\r", b"0.006\r"),
        (b"HARM 3;HARM?\r", b"3\r"),
        (b"AUXV 2,-1.5;AUXV? 2;AUXV? 1\r", b"-1.5\r0\r"),
        (b"OEXP 1,-5.5,2;OEXP? 1;OEXP? 2\r", b"-5.5,2\r0,0\r"),
        (b"OUTP? 1;OUTP?2\r", b"0\r0\r"),
        (b"SNAP?1,2,3,4,9,11\r", b"0,0,0,0,1000,0\r"),
        (b"OAUX? 1;OAUX? 2\r", b"0.111\r0\r"),
        (b"SENS 3;*RST;SENS?\r", b"26\r"),
        (b"OUTX?\r", b"0\r"),
        (b"OUTX 1;*IDN?;OUTX?\r", b""),
        (b"OUTX 1;*IDN?;OUTX 0;OUTX?\r", b"0\r"),
    ],
)
def test_commands_are_answered(ask, feed, command, answer):
    replies = feed(made().session(), command, trailing=b"*ID")
    expected = b"2\r3\r1\r1\r3\r2\r1\r" if answer is None else answer
    assert b"".join(text for _, text in replies) == expected
    assert all(text.count(b"\r") == 1 for _, text in replies)


@pytest.mark.parametrize(
    ("command", "status"),
    [
        *((bad, 1 << 4) for bad in (b"SENS 27", b"SENS -1", b"SENS 2.5", b"SENS", b"SENS 1,2", b"SENS x", b"SENS? 1")),
        *((bad, 1 << 4) for bad in (b"OFLT 20", b"OFSL 4", b"PHAS 730", b"SLVL 0.003", b"HARM 0", b"FREQ 102001")),
        *((bad, 1 << 4) for bad in (b"OUTP? 5", b"OUTP?", b"SNAP? 1", b"SNAP? 1,2,3,4,5,6,7", b"SNAP? 1,12")),
        *((bad, 1 << 4) for bad in (b"OAUX? 0", b"AUXV 5,1", b"AUXV 1,11", b"AOFF 4", b"AOFF", b"AGAN 1", b"*RST 1")),
        *((bad, 1 << 4) for bad in (b"HARM 103", b"FMOD 0;FREQ 100", b"HARM 100;FREQ 2000", b"LIAS? 8", b"*IDN? 1")),
        *((bad, 1 << 5) for bad in (b"HELP", b"HELP?", b"*OPC?", b"OUTP 1", b"APHS?", b"XY", b"1", b"*", b"?")),
        (b"*IDN?" + b" " * 300, 1 << 5),
    ],
)
def test_refusals_are_silent_and_leave_a_status(feed, ask, command, status):
    session = made().session()
    ask(session, b"*CLS\r")
    assert b"".join(text for _, text in feed(session, command + b"\r")) == b""
    assert ask(session, b"*ESR?;*ESR?\r") == b"%d\r0\r" % status


def test_a_refused_setting_stays(ask):
    assert ask(made().session(), b"SENS 20;SENS 27;SENS?\r") == b"20\r"


def test_a_query_takes_the_time_of_its_bytes(ask):
    session = made().session()
    ((due_s, text),) = session.receive(b"OUTP? 1\r", 5.0)
    assert_allclose(due_s, 5.0 + (8 + len(text)) * 10 / 9600 + 0.004)
    # what comes meanwhile waits for the line
    ((later_s, text),) = session.receive(b"*IDN?\r", 5.0)
    assert_allclose(later_s, 5.0 + (8 + 6 + len(text)) * 10 / 9600 + 0.004)
    ((due_s, _),) = made(baudrate=19_200).session().receive(b"OUTP? 1\r", 5.0)
    assert_allclose(due_s, 5.0 + (8 + 2) * 10 / 19_200 + 0.004)


def test_chained_queries_are_run_one_after_the_other():
    first, second, third = made().session().receive(b"SENS?;SENS?;SENS?\r", 5.0)
    arrival_s, reply_s = 5.0 + 18 * 10 / 9600, 3 * 10 / 9600
    assert_allclose(
        [first[0], second[0], third[0]], [arrival_s + number * 0.004 + reply_s for number in (1, 2, 3)], rtol=1e-12
    )


def test_the_outputs_are_the_light_in_volts(ask, lockin):
    assert ask(lockin, b"OUTP? 1;OUTP? 2;OUTP? 3;OUTP? 4\r", 10.0) == b"0.1\r0\r0.1\r0\r"
    # a square wave of 0.1 V rms at its fundamental has the mean 0.1 V pi / sqrt(8), told to a third of a millivolt
    assert ask(lockin, b"SNAP? 1,3,9,10,5\r", 10.0) == b"0.1,0.1,173,0.1,0.111\r"


def test_numbers_have_six_digits(ask):
    session = made(SteppedLight(3.592_999_7e-12)).session()
    ask(session, b"FMOD 0;PHAS 180\r")
    assert ask(session, b"OUTP? 1\r", 100.0) == b"-3.593e-07\r"
    session = made(SteppedLight(2.020_456_7e-9)).session()
    ask(session, b"FMOD 0\r")
    assert ask(session, b"OUTP? 3\r", 100.0) == b"0.000202046\r"


def test_the_phase_turns_x_into_y(ask):
    session = made(phase_deg=30.0).session()
    ask(session, b"FMOD 0\r")
    x, y, r, theta = map(float, ask(session, b"SNAP? 1,2,3,4\r", 10.0).split(b","))
    assert_allclose([x, y, r, theta], [0.1 * math.cos(math.pi / 6), 0.05, 0.1, 30.0], rtol=1e-5)
    ask(session, b"PHAS 120\r", 11.0)
    x, y, r, theta = map(float, ask(session, b"SNAP? 1,2,3,4\r", 20.0).split(b","))
    assert_allclose([x, y, r, theta], [0.0, -0.1, 0.1, -90.0], atol=1e-9)


@pytest.mark.parametrize(("harmonic", "share"), [(2, 0), (3, 1 / 3), (5, 1 / 5)])
def test_a_square_wave_has_odd_harmonics(ask, lockin, harmonic, share):
    ask(lockin, b"HARM %d\r" % harmonic, 10.0)
    assert_allclose(float(ask(lockin, b"OUTP? 3\r", 20.0)), 0.1 * share, rtol=1e-5)


@pytest.mark.parametrize("source", [2, 3])
def test_the_current_inputs_see_nothing(ask, lockin, source):
    ask(lockin, b"ISRC %d\r" % source, 10.0)
    assert float(ask(lockin, b"OUTP? 3\r", 20.0)) < 1e-9


def erlang(time, order):
    """How far `order` equal RC stages have followed a step after so many time constants."""
    return 1 - math.exp(-time) * sum(time**power / math.factorial(power) for power in range(order))


@pytest.mark.parametrize(("slope", "settled"), [(0, 5), (1, 7), (2, 9), (3, 10)])
def test_a_change_of_light_settles_as_the_filter_does(ask, slope, settled):
    light = SteppedLight(0.0, (100.0, FULL_W))
    session = made(light).session()
    ask(session, b"FMOD 0;OFLT 10;OFSL %d\r" % slope)
    for time in (0.5, 1.0, 2.0, 3.0, 5.0, settled):
        # the time that the query takes before it is run
        early_s = 8 * 10 / 9600 + 0.004
        found = float(ask(session, b"OUTP? 3\r", 100.0 + time - early_s)) / 0.1
        assert_allclose(found, erlang(time, slope + 1), atol=1e-4)
    assert_allclose(found, 0.99, atol=0.004)


def test_the_output_depends_on_the_time_alone(ask):
    steps = [(10.0 + 0.37 * number, FULL_W * (number % 3)) for number in range(60)]
    often, once = made(SteppedLight(0.0, *steps)).session(), made(SteppedLight(0.0, *steps)).session()
    for session in (often, once):
        ask(session, b"FMOD 0;OFLT 10;OFSL 2\r")
    for number in range(70):
        ask(often, b"OUTP? 1\r", 5.0 + number / 3)
    assert ask(often, b"OUTP? 1\r", 30.0) == ask(once, b"OUTP? 1\r", 30.0) != b"0\r"


def test_a_filter_follows_a_ramp_with_its_delay():
    for stages in (1, 2, 4):
        low_pass = LowPass(lambda start_s, duration_s: 3.0 * (start_s + duration_s / 2), 0.1, stages)
        lag_s = 50.0 - low_pass.output(50.0) / 3.0
        # a cell of 1/8 time constant counts as constant
        assert_allclose(lag_s, 0.1 * stages, rtol=2e-3)


def test_a_filter_that_was_not_asked_for_long_costs_25_time_constants():
    calls = []
    low_pass = LowPass(lambda start_s, _: calls.append(start_s) or 1.0, 1e-5, 2)
    low_pass.output(0.0)
    low_pass.output(1e5)
    assert len(calls) < 500
    assert min(calls[250:]) > 1e5 - 3e-4


def test_a_time_constant_that_is_set_anew_looks_back(ask, lockin):
    ask(lockin, b"OFLT 12\r", 1000.0)
    assert_allclose(float(ask(lockin, b"OUTP? 1\r", 1000.1)), 0.1, rtol=1e-5)


def test_an_overload_is_remembered_until_it_is_read(ask):
    light = SteppedLight(1e-9, (20.0, FULL_W), (30.0, 1e-9))
    session = made(light).session()
    # 200 uV full scale for 100 uV, then 100 mV for ten seconds
    ask(session, b"FMOD 0;SENS 15\r")
    ask(session, b"*CLS\r", 10.0)
    assert ask(session, b"LIAS?\r", 15.0) == b"0\r"
    assert float(ask(session, b"OUTP? 1\r", 25.0)) == pytest.approx(1.09 * 200e-6, rel=1e-5)
    assert ask(session, b"*STB?\r", 40.0) == b"10\r"
    assert ask(session, b"LIAS? 2;LIAS? 2\r", 40.0) == b"1\r0\r"
    assert ask(session, b"LIAS?\r", 40.0) == b"0\r"
    assert ask(session, b"*STB?\r", 41.0) == b"2\r"


def test_an_overload_between_two_queries_is_not_missed(ask):
    session = made(SteppedLight(1e-9, (20.0, FULL_W), (21.0, 1e-9))).session()
    ask(session, b"FMOD 0;SENS 15\r")
    ask(session, b"*CLS\r", 10.0)
    assert ask(session, b"LIAS?\r", 22.0) == b"4\r"
    ask(session, b"*CLS\r", 22.1)
    # 0.1 V falls to 0.2 mV in about nine time constants of 0.1 s
    assert ask(session, b"LIAS?\r", 23.0) == b"0\r"


def test_raising_the_sensitivity_ends_an_overload(ask):
    session = made().session()
    ask(session, b"FMOD 0;SENS 15\r")
    assert ask(session, b"LIAS?\r", 10.0) == b"%d\r" % (OUTPUT_OVERLOAD | UNLOCKED | RANGE_CHANGE)
    ask(session, b"SENS 23;OFLT 6\r", 11.0)
    ask(session, b"LIAS?\r", 11.1)
    assert ask(session, b"LIAS?;OUTP? 1\r", 15.0) == b"0\r0.1\r"


# 1 V of the fundamental's rms is a square wave that swings by 2.22 V; the input takes 1.41 V to either side
@pytest.mark.parametrize(
    ("light", "coupling", "is_too_much"),
    [
        (SteppedLight(1.26e-5), 0, False),
        (SteppedLight(1.29e-5), 0, True),
        (SteppedLight(0.62e-5), 1, False),
        (SteppedLight(0.65e-5), 1, True),
        # a level that does not swing passes no capacitor
        (SteppedLight(1e-6, dark_w=1e-5), 0, False),
        (SteppedLight(1e-6, dark_w=1e-5), 1, True),
        (SteppedLight(math.inf), 0, True),
    ],
)
def test_too_much_light_overloads_the_input(ask, light, coupling, is_too_much):
    session = made(light).session()
    ask(session, b"FMOD 0;ICPL %d\r" % coupling)
    ask(session, b"*CLS\r", 10.0)
    assert bool(int(ask(session, b"LIAS?\r", 15.0)) & INPUT_OVERLOAD) == is_too_much
    # whatever is detected of it
    ask(session, b"HARM 2\r", 20.0)
    ask(session, b"*CLS\r", 20.1)
    assert bool(int(ask(session, b"LIAS?\r", 25.0)) & INPUT_OVERLOAD) == is_too_much


def test_an_overload_that_was_read_does_not_come_back_with_another_time_constant(ask):
    session = made(SteppedLight(2e-5, (20.0, FULL_W))).session()
    ask(session, b"FMOD 0\r")
    assert int(ask(session, b"LIAS?\r", 25.0)) & INPUT_OVERLOAD
    # which looks back over 250 s
    ask(session, b"OFLT 12\r", 26.0)
    assert not int(ask(session, b"LIAS?\r", 30.0)) & INPUT_OVERLOAD


def test_without_power_it_keeps_its_settings_and_locks_again(ask):
    device = made()
    session = device.session()
    ask(session, b"FMOD 0;SENS 23;OFLT 7;AGAN\r")
    ask(session, b"*CLS\r", 0.5)
    device.power_cycle(1.0)
    assert ask(session, b"*ESR?;SENS?;OFLT?;*STB? 1\r", 3.0) == b"128\r23\r7\r1\r"
    assert int(ask(session, b"LIAS?\r", 4.0)) & UNLOCKED
    assert ask(session, b"LIAS?;OUTP? 1\r", 9.0) == b"0\r0.1\r"


def test_a_saturated_detector_is_an_overload_and_no_number_that_looks_like_light(ask):
    session = made(SteppedLight(math.inf)).session()
    ask(session, b"FMOD 0\r")
    x, y, r, theta = map(float, ask(session, b"SNAP? 1,2,3,4\r", 10.0).split(b","))
    assert (x, y, r, theta) == (1.09, 0.0, 1.09, 0.0)
    assert float(ask(session, b"OAUX? 1\r", 10.0)) == 10.5


def test_a_detector_that_is_saturated_at_all_times_shows_nothing_but_the_overload(ask):
    session = made(SteppedLight(FULL_W, dark_w=math.inf)).session()
    ask(session, b"FMOD 0\r")
    ask(session, b"*CLS\r", 9.0)
    assert ask(session, b"OUTP? 3;LIAS?\r", 10.0) == b"0\r1\r"


def test_what_the_chopper_does_not_chop_is_not_detected(ask, lockin):
    session = made(SteppedLight(dark_w=3e-7)).session()
    ask(session, b"FMOD 0\r")
    assert ask(session, b"SNAP? 1,2,3,4\r", 10.0) == ask(lockin, b"SNAP? 1,2,3,4\r", 10.0)
    # (1/2 1e-6 W + 3e-7 W) 1e5 V/W pi / sqrt(2)
    assert_allclose(float(ask(session, b"OAUX? 1\r", 10.0)), 0.1777, atol=2e-4)


@pytest.mark.parametrize(("slope", "stages"), [(0, 1), (1, 2), (3, 4)])
@pytest.mark.parametrize("cycles", [0.05, 0.2, 1.0])
def test_a_filter_lets_of_a_slow_oscillation_through_what_stages_of_rc_do(ask, slope, stages, cycles):
    """Light 1 + a sin(2 pi f t): the output's amplitude is a / (1 + (2 pi f tau)^2)^(n/2)."""

    class Oscillating(SteppedLight):
        def open_w(self, time_s, exposure_s):
            half = math.pi * cycles * exposure_s
            middle_s = time_s + exposure_s / 2
            return FULL_W * (1 + 0.5 * math.sin(half) / half * math.sin(2 * math.pi * cycles * middle_s))

    session = made(Oscillating()).session()
    ask(session, b"FMOD 0;OFLT 10;OFSL %d\r" % slope)
    found = [float(ask(session, b"OUTP? 1\r", 100.0 + 0.037 * number)) / 0.1 - 1 for number in range(1200)]
    amplitude = math.sqrt(2 * sum(value**2 for value in found) / len(found))
    assert_allclose(amplitude, 0.5 / (1 + (2 * math.pi * cycles) ** 2) ** (stages / 2), rtol=0.05, atol=2e-4)


def test_a_chopper_that_stops_unlocks_the_reference(ask):
    device = made()
    session = device.session()
    ask(session, b"FMOD 0\r")
    assert ask(session, b"LIAS?\r", 1.0) == b"%d\r" % (UNLOCKED | RANGE_CHANGE)
    assert ask(session, b"LIAS?;FREQ?\r", 2.0) == b"0\r173\r"
    device.set_chopper(0.0, 3.0)
    assert ask(session, b"LIAS?;LIAS?;FREQ?\r", 4.0) == b"8\r8\r0\r"
    assert float(ask(session, b"OUTP? 1\r", 9.0)) < 1e-9
    device.set_chopper(400.0, 10.0)
    # five periods to lock, and 400 Hz is in the upper range
    assert ask(session, b"LIAS?\r", 10.1) == b"%d\r" % (UNLOCKED | RANGE_CHANGE)
    assert ask(session, b"LIAS?;FREQ?\r", 11.0) == b"0\r400\r"
    assert ask(session, b"OUTP? 1\r", 15.0) == b"0.1\r"


def test_a_short_stop_of_the_chopper_is_remembered(ask, lockin):
    lockin._device.set_chopper(0.0, 5.0)
    lockin._device.set_chopper(173.0, 5.1)
    assert ask(lockin, b"LIAS?;LIAS?\r", 9.0) == b"8\r0\r"


def test_auto_functions_take_seconds_and_show_as_busy(ask):
    session = made(phase_deg=-70.0).session()
    ask(session, b"FMOD 0\r")
    ask(session, b"APHS;AGAN;ARSV;*CLS\r", 10.0)
    # 1 s and ten times 100 ms each
    assert ask(session, b"*STB? 1;PHAS?;SENS?;RMOD?\r", 11.9) == b"0\r0\r26\r1\r"
    assert ask(session, b"*STB? 1;PHAS?;SENS?;RMOD?\r", 12.2) == b"0\r-70\r26\r1\r"
    assert ask(session, b"*STB?;PHAS?;SENS?;RMOD?\r", 16.2) == b"2\r-70\r23\r2\r"
    assert ask(session, b"SNAP? 1,2\r", 16.5) == b"0.1,0\r"


def test_what_came_before_an_auto_gain_is_judged_by_the_sensitivity_of_that_time(ask):
    session = made(SteppedLight(FULL_W, (11.0, 1e-9))).session()
    ask(session, b"FMOD 0\r")
    ask(session, b"*CLS;AGAN\r", 10.0)
    assert ask(session, b"SENS?;LIAS?\r", 13.0) == b"15\r0\r"


def test_auto_gain_finds_its_way_out_of_an_overload(ask):
    session = made().session()
    ask(session, b"FMOD 0;SENS 3\r")
    ask(session, b"AGAN\r", 10.0)
    assert ask(session, b"SENS?;OUTP? 3\r", 13.0) == b"23\r0.1\r"


def test_an_offset_is_subtracted(ask, lockin):
    ask(lockin, b"SENS 24;AOFF 1\r", 10.0)
    x, r, _ = ask(lockin, b"OUTP? 1;OUTP? 3;*IDN?\r", 13.0).split(b"\r", 2)
    assert_allclose([float(x), float(r)], [0.0, 0.1], atol=1e-12)
    assert ask(lockin, b"OEXP? 1\r", 13.0) == b"50,0\r"
    ask(lockin, b"OEXP 1,25,0\r", 14.0)
    assert ask(lockin, b"SNAP? 1,3\r", 14.0) == b"0.05,0.1\r"
    ask(lockin, b"SENS 22;AOFF 3\r", 15.0)
    # 50 mV full scale: offsets end at 105 %, and 0.1 V ends at 109 %
    assert ask(lockin, b"OEXP? 3\r", 18.0) == b"105,0\r"


@pytest.mark.parametrize(
    ("command", "bandwidth_hz"),
    [
        (b"OFLT 8;OFSL 0", 1 / (4 * 0.1)),
        (b"OFLT 10;OFSL 1", 1 / 8),
        (b"OFLT 8;OFSL 2", 3 / (32 * 0.1)),
        (b"OFLT 8;OFSL 3", 5 / (64 * 0.1)),
    ],
)
def test_the_filter_decides_the_noise_of_x_and_of_y(ask, command, bandwidth_hz):
    """Density e of the detector's noise, after the noise bandwidth of equal RC stages.

    The detector has pi/sqrt(2) V/W, where its chopped light has 1 V/W of rms at the fundamental.
    """
    session = made(SteppedLight(density_w=1e-9)).session()
    ask(session, b"FMOD 0;" + command + b"\r")
    values = [list(map(float, ask(session, b"SNAP? 1,2\r", 100.0 * n).split(b","))) for n in range(1, 401)]
    xs, ys = [x - 0.1 for x, _ in values], [y for _, y in values]
    spread_v = VOLTS_PER_WATT * math.pi / math.sqrt(2) * 1e-9 * math.sqrt(bandwidth_hz)
    for found in (xs, ys):
        assert_allclose(math.sqrt(sum(value**2 for value in found) / len(found)), spread_v, rtol=0.12)
    assert abs(sum(x * y for x, y in zip(xs, ys, strict=True))) / len(xs) < 0.2 * spread_v**2


def test_readings_within_the_memory_of_the_filter_share_their_noise(ask):
    session = made(SteppedLight(density_w=1e-9)).session()
    ask(session, b"FMOD 0;OFLT 10;OFSL 0\r")
    first = ask(session, b"OUTP? 1\r", 100.0)
    assert ask(session, b"OUTP? 1\r", 101.9) == first
    assert ask(session, b"OUTP? 1\r", 102.1) != first


def test_it_may_wake_with_its_answers_at_gpib(ask):
    session = made(answers_at_gpib=True).session()
    assert ask(session, b"*IDN?\r") == b""
    assert ask(session, b"*RST;OUTX 0;OUTX?\r") == b"0\r"


def test_settings_belong_to_the_device_and_unfinished_lines_to_the_client(ask):
    device = made()
    first = device.session()
    ask(first, b"SENS 5\rSEN")
    assert ask(device.session(), b"SENS?\r") == b"5\r"
    assert ask(first, b"S?\r") == b"5\r"


def test_any_bytes_leave_it_answering(ask):
    random_ = random.Random(9)
    session = made().session()
    words = [b"SENS", b"OFLT?", b"SNAP?", b"OUTP?1", b"AOFF", b"*RST", b"AUXV1,", b"FMOD0", b"LIAS?", b";", b",", b"\r"]
    for number in range(10_000):
        noise = bytearray(b"".join(random_.choices(words, k=4)) + random_.randbytes(3) + b"\r")
        noise[random_.randrange(len(noise))] = random_.randrange(256)
        session.receive(bytes(noise), 0.02 * number)
    session.receive(b"x" * 100_000, 1e6)
    assert len(session._lines._unfinished) <= 257
    assert ask(session, b"\rOUTX 0\r*IDN?\r", 2e6).startswith(b"Stanford")
