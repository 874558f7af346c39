from __future__ import annotations

import cmath
import math
import re

import numpy as np
import pytest

from drivers.stanford_sr830.detector import StanfordSr830
from drivers.stanford_sr830.lock_in import (
    TIME_CONSTANTS_S,
    Condition,
    Settings,
    parse_condition,
    parse_offset,
    parse_sample,
)
from goniometer.errors import DeviceFaultError, LimitError, NotConnectedError, ReplyError, ReplyTimeoutError

IDENTITY = b"Stanford_Research_Systems,SR830,s/n12345,ver1.07\r"
ANSWERS = {
    b"*IDN?": IDENTITY,
    b"LIAS?": b"0\r",
    b"OFLT?": b"8\r",
    b"OFSL?": b"3\r",
    b"FMOD?": b"0\r",
    b"ISRC?": b"0\r",
    b"HARM?": b"1\r",
    b"OEXP? 3": b"0.0,0\r",
    b"SENS?": b"17\r",
    b"SNAP? 3,4,9,3,4": b"0.000202046,-12.5,317.25,0.000202046,-12.5\r",
}
TIME_CONSTANT_S, SETTLING_S = 0.1, 1.6

SETTINGS = [b"OFLT?", b"OFSL?", b"ISRC?", b"FMOD?", b"HARM?", b"OEXP? 3"]
OTHER_SETTINGS = [
    {b"OFLT?": b"9\r"},
    {b"OFSL?": b"2\r"},
    {b"FMOD?": b"1\r"},
    {b"ISRC?": b"2\r"},
    {b"HARM?": b"3\r"},
    {b"OEXP? 3": b"50,0\r"},
]


@pytest.fixture
def lock_in(make_peer, open_link, clock):
    def make(changes=None, reply_timeout_s=2.0, **parameters):
        peer = make_peer(ANSWERS | (changes or {}))
        link = open_link(peer.port, "lock_in", reply_timeout_s)
        parameters = {"settings": Settings(TIME_CONSTANT_S, 24), "noise_w": 1e-9} | parameters
        return peer, StanfordSr830(link, clock, name="lock_in", responsivity_v_per_w=2.0, **parameters)

    return make


@pytest.fixture
def finish(clock):
    """Poll every 10 ms of the test's clock until the reading has ended; return how long it took."""

    def poll(lock_in):
        begun_s = clock.time_s
        while lock_in.is_reading():
            clock.time_s += 0.01
            assert clock.time_s - begun_s < 1000, "never ended"
        return clock.time_s - begun_s

    return poll


class TestAnswers:
    def test_sample(self):
        sample = parse_sample("lock_in", "0.000202046,-3.59302e-07, 317.25,0.000202046,-3.59302e-07")
        assert (sample.magnitude_v, sample.phase_deg, sample.reference_hz) == (0.000202046, -3.59302e-07, 317.25)

    @pytest.mark.parametrize(
        "answer",
        [
            *["", "0.1", "0.1,0.2", "0.1,0.2,0.3", "0.1,0.2,0.3,0.1", "0.1,0.2,0.3,0.1,0.2,0.3", "0.1,,0.3,0.1,"],
            *["nan,0,1,nan,0", "a,b,c,a,b", "0.1,0.2,0.3,0.5,0.2", "0.1,0.2,0.3,0.1,0.6", "0.1,0.2,,0.1,0.2"],
        ],
    )
    def test_malformed_sample_is_refused(self, answer):
        with pytest.raises(ReplyError, match=r"lock_in: the answer to 'SNAP\? 3,4,9,3,4'"):
            parse_sample("lock_in", answer)

    @pytest.mark.parametrize(
        ("answer", "condition"),
        [
            ("0", Condition(0)),
            ("1", Condition.INPUT_OVERLOAD),
            ("6", Condition.FILTER_OVERLOAD | Condition.OUTPUT_OVERLOAD),
            ("8", Condition.UNLOCKED),
            ("255", ~Condition(0)),
        ],
    )
    def test_condition(self, answer, condition):
        assert parse_condition("lock_in", answer) == condition

    @pytest.mark.parametrize("answer", ["", "-1", "256", "1.5", "x"])
    def test_malformed_condition_is_refused(self, answer):
        with pytest.raises(ReplyError, match=r"LIAS"):
            parse_condition("lock_in", answer)

    def test_time_constants_go_from_10_us_to_30_ks_in_steps_of_1_and_3(self):
        constants_s = TIME_CONSTANTS_S
        assert (len(constants_s), constants_s[:4]) == (20, (10e-6, 30e-6, 100e-6, 300e-6))
        assert (constants_s[8], constants_s[10], constants_s[19]) == (0.1, 1.0, 30e3)
        np.testing.assert_allclose(np.array(constants_s[2:]) / constants_s[:-2], 10)

    def test_any_bytes_are_read_or_refused(self):
        random = np.random.default_rng(4)
        whole = np.frombuffer(b"0.000202046,-12.5,317.25", np.uint8)
        for _ in range(30_000):
            mutated = whole.copy()
            mutated[random.integers(len(whole), size=random.integers(1, 4))] = random.integers(0, 256, dtype=np.uint8)
            text = mutated[: random.integers(len(whole) + 1)].tobytes().decode("ascii", errors="replace")
            for parse in (parse_sample, parse_condition):
                try:
                    parse("lock_in", text)
                except ReplyError:
                    continue
                assert parse is parse_condition or text.count(",") == 2


class TestConnecting:
    def test_answers_are_sent_here_before_anything_is_asked(self, lock_in):
        peer, lock_in = lock_in()
        assert lock_in.connect() == ()
        assert peer.commands == [b"OUTX 0", b"*IDN?", b"*IDN?", b"LIAS?", *SETTINGS]

    def test_settings_are_set_where_they_are_others_and_told(self, lock_in):
        filters = {b"OFLT?": [b"10\r", b"8\r"], b"OFSL?": [b"1\r", b"3\r"], b"FMOD?": [b"1\r", b"0\r"]}
        others = {b"HARM?": [b"3\r", b"1\r"], b"ISRC?": [b"1\r", b"0\r"], b"OEXP? 3": [b"-12.5,1\r", b"0,0\r"]}
        peer, lock_in = lock_in(filters | others)
        notes = lock_in.connect()
        told = [b"OFLT 8", b"OFSL 3", b"ISRC 0", b"FMOD 0", b"HARM 1", b"OEXP 3,0,0"]
        assert peer.commands[4:] == [*SETTINGS, *told, *SETTINGS]
        was = "time constant 1 s/slope 12 dB/input A-B/internal reference/harmonic 3/offset of R -12.5 %"
        assert notes == tuple(f"{setting}, which was changed" for setting in was.split("/"))

    def test_input_is_the_one_of_the_rig_file(self, lock_in):
        settings = Settings(TIME_CONSTANT_S, 24, "A-B")
        peer, lock_in = lock_in({b"ISRC?": [b"0\r", b"1\r"]}, settings=settings)
        assert lock_in.connect() == ("input A, which was changed",)
        assert b"ISRC 1" in peer.commands

    @pytest.mark.parametrize("kept", OTHER_SETTINGS)
    def test_lock_in_that_keeps_other_settings_is_refused(self, lock_in, kept):
        _, lock_in = lock_in(kept)
        with pytest.raises(ReplyError, match=r"lock_in: the answer to 'OFLT\? \.\.\. OEXP\?' is .* just set"):
            lock_in.connect()

    @pytest.mark.parametrize("answer", [b"", b"1", b"1,2,3", b"x,0", b"nan,0"])
    def test_malformed_offset_is_refused(self, answer):
        with pytest.raises(ReplyError, match=r"OEXP\? 3"):
            parse_offset("lock_in", answer.decode())

    def test_what_was_left_over_is_told(self, lock_in):
        _, lock_in = lock_in({b"LIAS?": b"45\r"})
        assert lock_in.connect() == ("input overload", "output overload", "unlocked")

    def test_sr810_is_one_too(self, lock_in):
        _, lock_in = lock_in({b"*IDN?": b"Stanford_Research_Systems,SR810,s/n1,ver1.0\r"})
        lock_in.connect()

    def test_other_device_is_refused(self, lock_in):
        _, lock_in = lock_in({b"*IDN?": b"Stanford_Research_Systems,SR400,s/n1,ver1.0\r" * 40})
        with pytest.raises(ReplyError, match="identity with STANFORD_RESEARCH_SYSTEMS,SR8 in it"):
            lock_in.connect()

    def test_another_lock_in_is_not_taken_for_the_one_before(self, lock_in):
        _, lock_in = lock_in({b"*IDN?": [IDENTITY, IDENTITY, IDENTITY.replace(b"12345", b"54321")]})
        lock_in.connect()
        lock_in.reconnect()
        with pytest.raises(DeviceFaultError, match="lock_in: another device answers since the link was lost"):
            lock_in.connect()

    def test_silent_device_is_a_timeout(self, lock_in):
        _, lock_in = lock_in({b"*IDN?": b""}, reply_timeout_s=0.02)
        with pytest.raises(ReplyTimeoutError, match=r"lock_in: no complete answer to b'\*IDN\?"):
            lock_in.connect()


class TestReading:
    def test_settles_then_averages_and_takes_no_longer(self, lock_in, finish):
        peer, lock_in = lock_in()
        lock_in.start_reading(0.5)
        np.testing.assert_allclose(finish(lock_in), SETTLING_S + 0.5, atol=0.07)
        np.testing.assert_allclose(lock_in.power_w(), 0.000202046 / 2, rtol=1e-12)
        assert lock_in.reference_hz == 317.25
        assert peer.commands == [b"LIAS?", *SETTINGS, b"LIAS?", *[b"SNAP? 3,4,9,3,4"] * 5, b"LIAS?"]
        assert not lock_in.is_reading()

    @pytest.mark.parametrize(("slope", "stages"), [(0, 1), (1, 2), (2, 3), (3, 4)])
    @pytest.mark.parametrize(("index", "constant_s"), [(8, 0.1), (9, 0.3), (10, 1.0)])
    def test_settling_leaves_a_ten_thousandth_of_a_step(self, lock_in, clock, slope, stages, index, constant_s):
        """A step passes `stages` equal RC stages but for exp(-n) sum n^j / j! after n time constants."""
        settings = Settings(constant_s, 6 * stages)
        left = settings.settling_s / constant_s
        left = math.exp(-left) * sum(left**order / math.factorial(order) for order in range(stages))
        assert 0.8e-4 < left < 1e-4
        peer, lock_in = lock_in({b"OFLT?": b"%d\r" % index, b"OFSL?": b"%d\r" % slope}, settings=settings)
        lock_in.start_reading(0.5)
        clock.time_s = settings.settling_s - 1e-6
        assert lock_in.is_reading()
        assert peer.commands[-1] == SETTINGS[-1]
        clock.time_s += 2e-6
        assert lock_in.is_reading()
        assert peer.commands[-1] == b"LIAS?"

    def test_one_sample_is_enough_where_the_filter_is_slower_than_the_exposure(self, lock_in, finish):
        peer, lock_in = lock_in({b"OFLT?": b"10\r"}, settings=Settings(1.0, 24))
        lock_in.start_reading(0.2)
        np.testing.assert_allclose(finish(lock_in), 16.2, atol=0.05)
        assert peer.commands.count(b"SNAP? 3,4,9,3,4") == 1

    def test_fast_filter_does_not_ask_faster_than_the_poll(self, lock_in, finish):
        peer, lock_in = lock_in({b"OFLT?": b"0\r"}, settings=Settings(10e-6, 24))
        lock_in.start_reading(0.2)
        finish(lock_in)
        assert 15 <= peer.commands.count(b"SNAP? 3,4,9,3,4") <= 21

    def test_samples_are_averaged_as_complex_numbers(self, lock_in, finish):
        samples = [(1e-3, 40.0), (3e-3, 100.0), (2e-3, -80.0)]
        answers = [b"%g,%g,300,%g,%g\r" % (*sample, *sample) for sample in samples]
        _, lock_in = lock_in({b"SNAP? 3,4,9,3,4": answers})
        lock_in.start_reading(0.3)
        finish(lock_in)
        mean = sum(cmath.rect(volts, math.radians(degrees)) for volts, degrees in samples) / 3
        np.testing.assert_allclose(lock_in.power_w(), abs(mean) / 2, rtol=1e-9)

    def test_little_light_is_told_with_its_sign_in_phase_with_the_light_seen_last(self, lock_in, finish):
        """Noise in the dark then averages to nothing, which its magnitude does not."""
        answers = [
            b"2e-9,100,300,2e-9,100\r",
            b"1e-6,70,300,1e-6,70\r",
            b"2e-9,100,300,2e-9,100\r",
            b"2e-9,-110,300,2e-9,-110\r",
            b"1e-6,-20,300,1e-6,-20\r",
        ]
        _, lock_in = lock_in({b"SNAP? 3,4,9,3,4": [*answers, answers[0]]})
        told_w = []
        for _ in range(6):
            lock_in.start_reading(0.1)
            finish(lock_in)
            told_w.append(lock_in.power_w())
        cosines = [1, 1, math.cos(math.radians(30)), -1, 1, math.cos(math.radians(120))]
        np.testing.assert_allclose(told_w, np.array([1e-9, 5e-7, 1e-9, 1e-9, 5e-7, 1e-9]) * cosines, rtol=1e-9)

    @pytest.mark.parametrize(("reference", "sign"), [(b"0\r", -1), (b"1\r", 1)])
    def test_phase_of_the_light_is_kept_over_a_lost_link_unless_the_lock_in_was_reset(
        self, lock_in, finish, reference, sign
    ):
        bright, dim = b"1e-6,70,300,1e-6,70\r", b"2e-9,-110,300,2e-9,-110\r"
        peer, lock_in = lock_in({b"SNAP? 3,4,9,3,4": [bright, dim]})
        lock_in.connect()
        lock_in.start_reading(0.1)
        finish(lock_in)
        np.testing.assert_allclose(lock_in.power_w(), 5e-7, rtol=1e-9)
        lock_in.reconnect()
        peer._answers |= {b"FMOD?": [reference, b"0\r"]}
        lock_in.connect()
        lock_in.start_reading(0.1)
        finish(lock_in)
        np.testing.assert_allclose(lock_in.power_w(), sign * 1e-9, rtol=1e-9)

    @pytest.mark.parametrize("changed", OTHER_SETTINGS)
    def test_reset_lock_in_gives_no_reading(self, lock_in, finish, changed):
        peer, lock_in = lock_in()
        lock_in.connect()
        lock_in.start_reading(0.5)
        finish(lock_in)
        peer._answers |= {question: [answer] for question, answer in changed.items()}
        with pytest.raises(DeviceFaultError, match="lock_in: the lock-in was reset, or set otherwise"):
            lock_in.start_reading(0.5)
        assert not lock_in.is_reading()
        with pytest.raises(ReplyError, match="there is no finished reading"):
            lock_in.power_w()

    @pytest.mark.parametrize("exposure_s", [0.0, -1.0, math.nan, math.inf])
    def test_impossible_exposure_is_refused_before_the_first_byte(self, lock_in, exposure_s):
        peer, lock_in = lock_in()
        with pytest.raises(LimitError, match=f"lock_in: an exposure of {exposure_s:g} s"):
            lock_in.start_reading(exposure_s)
        assert peer.commands == []

    def test_no_reading_is_not_a_power(self, lock_in):
        _, lock_in = lock_in()
        for start in (lambda: None, lambda: lock_in.start_reading(0.5)):
            start()
            with pytest.raises(ReplyError, match="lock_in: there is no finished reading"):
                lock_in.power_w()


class TestSpoiltReadings:
    """The three answers to LIAS? are those at the start, after settling, and after averaging."""

    @pytest.mark.parametrize(
        ("conditions", "text"),
        [
            ((b"0\r", b"0\r", b"1\r"), "the detector was saturated: the lock-in reports input overload"),
            ((b"0\r", b"0\r", b"2\r"), "the detector was saturated: the lock-in reports filter overload"),
            ((b"0\r", b"0\r", b"5\r"), "saturated: the lock-in reports input overload and output overload"),
            ((b"0\r", b"0\r", b"8\r"), "the lock-in reports unlocked during the reading"),
            ((b"0\r", b"8\r", b"0\r"), "the lock-in reports unlocked during the reading"),
            ((b"0\r", b"32\r", b"0\r"), "the lock-in reports time constant changed"),
        ],
    )
    def test_overload_and_lost_reference_are_faults(self, lock_in, finish, conditions, text):
        _, lock_in = lock_in({b"LIAS?": list(conditions)})
        lock_in.start_reading(0.5)
        finish(lock_in)
        with pytest.raises(DeviceFaultError, match=f"lock_in: .*{text}"):
            lock_in.power_w()

    @pytest.mark.parametrize("conditions", [(b"15\r", b"0\r"), (b"0\r", b"7\r", b"0\r"), (b"0\r", b"0\r", b"16\r")])
    def test_what_happened_before_the_filter_had_settled_is_forgiven(self, lock_in, finish, conditions):
        _, lock_in = lock_in({b"LIAS?": list(conditions)})
        lock_in.start_reading(0.5)
        finish(lock_in)
        assert lock_in.power_w() > 0

    OVERLOADED_ONCE = (b"0\r", b"0\r", b"4\r", b"0\r")

    def test_sensitivity_is_raised_when_told_so(self, lock_in, finish):
        changes = {b"LIAS?": list(self.OVERLOADED_ONCE), b"SENS?": [b"17\r", b"18\r"]}
        peer, lock_in = lock_in(changes, raises_sensitivity=True)
        lock_in.start_reading(0.5)
        np.testing.assert_allclose(finish(lock_in), 2 * (SETTLING_S + 0.5), atol=0.15)
        assert lock_in.power_w() > 0
        assert peer.commands.count(b"SENS 18") == 1

    def test_sensitivity_is_not_raised_otherwise(self, lock_in, finish):
        peer, lock_in = lock_in({b"LIAS?": list(self.OVERLOADED_ONCE)})
        lock_in.start_reading(0.5)
        finish(lock_in)
        with pytest.raises(DeviceFaultError, match="saturated"):
            lock_in.power_w()
        assert b"SENS 18" not in peer.commands

    def test_least_sensitive_range_is_the_end(self, lock_in, finish):
        peer, lock_in = lock_in({b"LIAS?": b"4\r", b"SENS?": b"26\r"}, raises_sensitivity=True)
        lock_in.start_reading(0.5)
        finish(lock_in)
        with pytest.raises(DeviceFaultError, match="saturated"):
            lock_in.power_w()
        assert not [command for command in peer.commands if command.startswith(b"SENS ")]

    def test_sensitivity_that_is_not_held_is_refused(self, lock_in, finish):
        _, lock_in = lock_in({b"LIAS?": b"4\r"}, raises_sensitivity=True)
        lock_in.start_reading(0.5)
        with pytest.raises(ReplyError, match=re.escape("'17', which is not the sensitivity 18 just set")):
            finish(lock_in)


class TestLine:
    def test_lost_sample_is_asked_for_again(self, lock_in, finish):
        peer, lock_in = lock_in({b"SNAP? 3,4,9,3,4": [b"", b"0.5,0,300,0.5,0\r"]}, reply_timeout_s=0.05)
        lock_in.start_reading(0.1)
        finish(lock_in)
        assert lock_in.power_w() == 0.25
        assert peer.commands[-5:] == [b"SNAP? 3,4,9,3,4", b"OUTX 0", b"*IDN?", b"SNAP? 3,4,9,3,4", b"LIAS?"]

    def test_late_sample_is_not_taken_for_the_next_one(self, lock_in, finish):
        changes = {b"SNAP? 3,4,9,3,4": [b"", b"0.5,0,300,0.5,0\r"], b"*IDN?": b"0.9,0,300,0.9,0\r" + IDENTITY}
        _, lock_in = lock_in(changes, reply_timeout_s=0.05)
        lock_in.start_reading(0.1)
        finish(lock_in)
        assert lock_in.power_w() == 0.25

    @pytest.mark.parametrize(
        "garbage", [b"\r", b"0.2,0\r", b"0.2,0.1,3\xff7,0.2,0.1\r", b"0.2,0,300,\r", b"0.2,0,300,0.6,0\r"]
    )
    def test_garbled_sample_is_asked_for_again_and_never_used(self, lock_in, finish, garbage):
        _, lock_in = lock_in({b"SNAP? 3,4,9,3,4": [garbage, b"0.5,0,300,0.5,0\r"]})
        lock_in.start_reading(0.1)
        finish(lock_in)
        assert lock_in.power_w() == 0.25

    def test_condition_is_never_asked_for_twice_for_one_answer(self, lock_in):
        peer, lock_in = lock_in({b"LIAS?": b""}, reply_timeout_s=0.02)
        with pytest.raises(ReplyTimeoutError, match="LIAS"):
            lock_in.start_reading(0.5)
        assert peer.commands == [b"LIAS?"]

    def test_endless_output_is_an_error(self, lock_in, clock):
        _, lock_in = lock_in({b"SNAP? 3,4,9,3,4": b"7" * 100_000}, reply_timeout_s=0.1)
        lock_in.start_reading(0.1)
        clock.time_s = SETTLING_S
        lock_in.is_reading()
        with pytest.raises((ReplyError, ReplyTimeoutError), match="lock_in: "):
            lock_in.is_reading()

    def test_lost_link_ends_the_reading_and_the_next_one_is_whole(self, lock_in, clock, finish):
        peer, lock_in = lock_in()
        lock_in.start_reading(0.5)
        peer.vanish()
        clock.time_s = SETTLING_S
        with pytest.raises(NotConnectedError, match=r"lock_in: the link on port .* is gone"):
            lock_in.is_reading()
        lock_in.reconnect()
        assert not lock_in.is_reading()
        with pytest.raises(ReplyError, match="there is no finished reading"):
            lock_in.power_w()
        lock_in.start_reading(0.5)
        finish(lock_in)
        assert lock_in.power_w() > 0
        assert peer.commands[1 + len(SETTINGS) :][:3] == [b"OUTX 0", b"*IDN?", b"LIAS?"]
