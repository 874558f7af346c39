from __future__ import annotations

import re

import numpy as np
import pytest

from drivers.thorlabs_pm100.meter import ThorlabsPm100, parse_error
from drivers.wire.framing import take_frame
from goniometer.errors import DeviceFaultError, LimitError, NotConnectedError, ReplyError, ReplyTimeoutError

NONE = b'+0,"No error"\n'
ANSWERS = {
    b"*IDN?": b"THORLABS,PM100D,P0012345,2.8.0\n",
    b"SYST:ERR?": NONE,
    b"SENS:CORR?": b"0.0\n",
    b"SENS:CORR:WAV? MIN": b"400\n",
    b"SENS:CORR:WAV? MAX": b"1100\n",
    b"SENS:CORR:WAV?": b"550\n",
    b"SENS:AVER?": b"10\n",
    b"MEAS:POW?": b"1.234205E-03\n",
    b"FETC?": b"1.234205E-03\n",
}
READING = [b"MEAS:POW?", b"FETC?", b"SENS:AVER?"]
RESYNCHRONISING = [b"SENS:POW:UNIT W", b"*IDN?"]


@pytest.fixture
def meter(make_peer, open_link, clock):
    def make(reply_timeout_s=2.0, changes=None, **parameters):
        peer = make_peer(ANSWERS | (changes or {}), terminator=b"\n")
        link = open_link(peer.port, "meter", reply_timeout_s)
        return peer, ThorlabsPm100(link, clock, name="meter", sample_s=0.003, **parameters)

    return make


ERRORS = [
    (b'0,"No error"\n', (0, "No error")),
    (b'+0,"No error"\r\n', (0, "No error")),
    (b'-113,"Undefined header"\n', (-113, "Undefined header")),
    (b"-222, Data out of range\n", (-222, "Data out of range")),
]


@pytest.mark.parametrize(("sent", "error"), ERRORS)
@pytest.mark.parametrize("trailing", [b"", b"1.0E-3\n"])
def test_error_report_fed_whole(sent, error, trailing):
    received = bytearray(sent + trailing)
    assert parse_error("meter", take_frame(received, b"\n").decode().strip()) == error
    assert received == trailing


@pytest.mark.parametrize(("sent", "error"), ERRORS)
def test_error_report_fed_byte_by_byte(sent, error):
    received, frames = bytearray(), []
    for byte in sent:
        received.append(byte)
        frames.append(take_frame(received, b"\n"))
    assert frames[:-1] == [None] * (len(sent) - 1)
    assert parse_error("meter", frames[-1].decode().strip()) == error


@pytest.mark.parametrize("line", ["", "No error", "1.0E-3", "0"])
def test_malformed_error_report_is_refused(line):
    with pytest.raises(ReplyError, match="not an error code and its text"):
        parse_error("meter", line)


def test_connects_and_returns_old_errors(meter):
    peer, meter = meter(changes={b"SYST:ERR?": [b'-113,"Undefined header"\n', NONE]})
    assert meter.connect() == ("-113 Undefined header",)
    assert peer.commands == [
        *(b"SENS:POW:UNIT W", b"*IDN?", b"*IDN?", b"SYST:ERR?", b"SYST:ERR?"),
        *(b"SENS:POW:UNIT W", b"SENS:POW:RANG:AUTO 1", b"SYST:ERR?", b"SENS:CORR?"),
    ]


def test_meter_without_a_sensor_is_a_fault(meter):
    _, meter = meter(changes={b"SYST:ERR?": [NONE, b'-241,"Hardware missing"\n', NONE]})
    with pytest.raises(
        DeviceFaultError, match="meter: the meter refused watts and automatic range: -241 Hardware missing"
    ):
        meter.connect()


@pytest.mark.parametrize(("held", "rig_db", "factor"), [(b"3\n", 0.0, "1.995"), (b"0\n", 20.0, "0.01")])
def test_correction_for_another_attenuator_is_refused_and_left_alone(meter, held, rig_db, factor):
    peer, meter = meter(changes={b"SENS:CORR?": held}, attenuation_db=rig_db)
    with pytest.raises(DeviceFaultError, match=rf"meter: .* wrong by a factor of {factor}\. .*attenuation_db: "):
        meter.connect()
    assert not [command for command in peer.commands if command.startswith(b"SENS:CORR ")]


def test_correction_for_the_attenuator_of_the_rig_file_is_taken(meter):
    _, meter = meter(changes={b"SENS:CORR?": b"20.001\n"}, attenuation_db=20.0)
    assert meter.connect() == ()


def test_other_device_on_the_port_is_refused(meter):
    _, meter = meter(changes={b"*IDN?": b"Stanford_Research_Systems,SR830\n" * 40})
    with pytest.raises(ReplyError, match="identity with THORLABS in it"):
        meter.connect()


def test_silent_meter_is_a_timeout(meter):
    _, meter = meter(reply_timeout_s=0.02, changes={b"*IDN?": b""})
    with pytest.raises(ReplyTimeoutError, match=r"meter: no complete answer to b'\*IDN\?"):
        meter.connect()


def test_reading(meter, until):
    peer, meter = meter()
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    assert meter.power_w() == 1.234205e-3
    assert not meter.is_reading()
    assert peer.commands == [b"SENS:AVER 10", *READING]


def test_light_is_collected_for_the_exposure_and_until_an_answer_has_come(meter, clock, until):
    """Bytes that come before the exposure is over are no answer to it; confirmed it is afterwards."""
    peer, meter = meter()
    meter.start_reading(0.03)
    until(lambda: b"MEAS:POW?" in peer.commands)
    assert meter.is_exposing()
    clock.sleep(0.029)
    assert meter.is_exposing()
    clock.sleep(0.001)
    until(lambda: not meter.is_exposing())
    assert peer.commands == [b"SENS:AVER 10", b"MEAS:POW?"]
    assert not meter.is_reading()
    assert not meter.is_exposing()
    assert peer.commands == [b"SENS:AVER 10", *READING]


@pytest.mark.usefixtures("no_real_grace")
def test_an_answer_that_does_not_come_is_no_light(meter, clock, until):
    _, meter = meter(changes={b"MEAS:POW?": b""})
    meter.start_reading(0.03)
    clock.sleep(2.0)
    assert meter.is_exposing()
    clock.sleep(0.1)
    assert not meter.is_exposing()


def test_averaging_is_sent_only_when_it_changes(meter, until):
    peer, meter = meter()
    for _ in range(3):
        meter.start_reading(0.03)
        until(lambda: not meter.is_reading())
    assert peer.commands == [b"SENS:AVER 10", *READING, *READING, *READING]


@pytest.mark.parametrize(("exposure_s", "count"), [(0.03, 10), (0.0311, 10), (0.0289, 10), (0.3, 100), (1e-9, 1)])
def test_exposure_is_the_nearest_whole_number_of_samples(meter, until, exposure_s, count):
    peer, meter = meter(changes={b"SENS:AVER?": b"%d\n" % count})
    meter.start_reading(exposure_s)
    until(lambda: not meter.is_reading())
    assert peer.commands[0] == b"SENS:AVER %d" % count
    np.testing.assert_allclose(meter.actual_exposure_s, count * 0.003, rtol=1e-12)


@pytest.mark.parametrize("exposure_s", [9.01, 1e300, 0.0, -0.03, float("nan"), float("inf")])
def test_exposure_that_the_meter_cannot_average_is_refused_before_the_first_byte(meter, until, exposure_s):
    peer, meter = meter()
    with pytest.raises(LimitError, match=re.escape(f"meter: an exposure of {exposure_s:g} s is not between 0 and 9 s")):
        meter.start_reading(exposure_s)
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    assert peer.commands[0] == b"SENS:AVER 10"


def test_longest_exposure_is_allowed(meter):
    _, meter = meter(changes={b"SENS:AVER?": b"3000\n"})
    meter.start_reading(9.0)
    np.testing.assert_allclose(meter.actual_exposure_s, 9.0, rtol=1e-12)


def test_averaging_that_the_meter_does_not_hold_is_a_fault(meter, until):
    """It would also be that of a meter that was switched off and on: it averages over one sample."""
    _, meter = meter(changes={b"SENS:AVER?": [b"10\n", b"1\n"]})
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    meter.start_reading(0.03)
    with pytest.raises(DeviceFaultError, match="with 1, which is not the averaging count 10 that it was told"):
        until(lambda: not meter.is_reading())
    with pytest.raises(ReplyError, match="there is no finished reading"):
        meter.power_w()


def test_one_sample_is_no_proof_of_the_settings_and_so_the_wavelength_is_asked_for(meter, until):
    _, meter = meter(changes={b"SENS:AVER?": b"1\n", b"SENS:CORR:WAV?": [b"550\n", b"550\n", b"635\n"]})
    meter.set_wavelength_nm(550)
    meter.start_reading(0.003)
    until(lambda: not meter.is_reading())
    meter.start_reading(0.003)
    with pytest.raises(DeviceFaultError, match="with 635, which is not the 550 nm that it was told"):
        until(lambda: not meter.is_reading())


@pytest.mark.usefixtures("no_real_grace")
def test_reading_has_twice_its_exposure_and_two_seconds_three_times_over(meter, clock, until):
    peer, meter = meter(changes={b"MEAS:POW?": b""})
    meter.start_reading(0.03)
    for attempt in (1, 2, 3):
        until(lambda: peer.commands.count(b"MEAS:POW?") == attempt)  # noqa: B023
        began_s = clock.time_s
        clock.time_s = began_s + 2.06 - 1e-6
        assert meter.is_reading()
        clock.time_s = began_s + 2.06 + 1e-6
        if attempt < 3:
            assert meter.is_reading()
    with pytest.raises(ReplyTimeoutError, match=r"meter: no reading .* exposure of 0\.03 s"):
        meter.is_reading()


@pytest.mark.usefixtures("no_real_grace")
def test_late_reading_is_not_taken_for_the_next_one(meter, clock, until):
    earlier = b"8.000000E-01\n" + ANSWERS[b"*IDN?"]
    changes = {b"MEAS:POW?": [b"", b"1.000000E-06\n"], b"FETC?": b"1.000000E-06\n", b"*IDN?": earlier}
    peer, meter = meter(changes=changes)
    meter.start_reading(0.03)
    clock.time_s = 10
    assert meter.is_reading()
    peer.say(b"9.000000E-01\n")
    until(lambda: not meter.is_reading())
    assert meter.power_w() == 1e-6
    assert peer.commands[1:5] == [b"MEAS:POW?", *RESYNCHRONISING, b"MEAS:POW?"]


@pytest.mark.usefixtures("no_real_grace")
def test_late_identity_does_not_put_readings_one_behind(meter, clock, until):
    identity = ANSWERS[b"*IDN?"]
    readings = [b"", b"1.000000E-06\n", b"2.000000E-06\n"]
    changes = {
        b"MEAS:POW?": readings,
        b"FETC?": readings[1:],
        b"*IDN?": [b"", b"9.000000E-01\n" + 2 * identity],
    }
    _, meter = meter(reply_timeout_s=0.05, changes=changes)
    meter.start_reading(0.03)
    clock.time_s = 10
    assert meter.is_reading()
    for power_w in (1e-6, 2e-6):
        until(lambda: not meter.is_reading())
        assert meter.power_w() == power_w
        meter.start_reading(0.03)


def test_reading_that_is_garbage_is_taken_again(meter, until):
    peer, meter = meter(changes={b"MEAS:POW?": [b"0,No error\n", ANSWERS[b"MEAS:POW?"]]})
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    assert meter.power_w() == 1.234205e-3
    assert peer.commands[1:] == [b"MEAS:POW?", *RESYNCHRONISING, *READING]


def test_reading_with_a_wrong_digit_is_taken_again(meter, until):
    peer, meter = meter(changes={b"MEAS:POW?": [b"1.234205E-01\n", ANSWERS[b"MEAS:POW?"]]})
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    assert meter.power_w() == 1.234205e-3
    assert peer.commands[1:] == [*READING, *READING]


def test_reading_whose_digits_are_wrong_again_and_again_is_refused(meter, until):
    _, meter = meter(changes={b"MEAS:POW?": b"1.234205E-01\n"})
    meter.start_reading(0.03)
    with pytest.raises(ReplyError, match=r"'MEAS:POW\?' is '0.123421', which is not the 0.0012342 of FETC"):
        until(lambda: not meter.is_reading())


def test_answer_that_comes_twice_is_not_taken_for_the_next_reading(meter, until):
    """The 10 of the averaging count comes a second time when the next reading has been asked for."""
    _, meter = meter(
        changes={
            b"MEAS:POW?": [b"1.0E-06\n", b"10\n2.0E-06\n", b"3.0E-06\n"],
            b"FETC?": [b"1.0E-06\n", b"2.0E-06\n", b"3.0E-06\n"],
        }
    )
    for power_w in (1e-6, 3e-6):
        meter.start_reading(0.03)
        until(lambda: not meter.is_reading())
        assert meter.power_w() == power_w


def test_connects_behind_a_line_that_another_program_left_unfinished(make_peer, open_link, clock):
    peer = make_peer(ANSWERS, terminator=b"\n")
    link = open_link(peer.port, "meter")
    link.write(b"SENS:CORR -6")
    ThorlabsPm100(link, clock, name="meter", sample_s=0.003).connect()
    assert peer.commands[:2] == [b"SENS:CORR -6SENS:POW:UNIT W", b"*IDN?"]


def test_no_reading_is_not_a_power(meter):
    _, meter = meter()
    with pytest.raises(ReplyError, match="meter: there is no finished reading"):
        meter.power_w()
    meter.start_reading(0.03)
    with pytest.raises(ReplyError, match="meter: there is no finished reading"):
        meter.power_w()


@pytest.mark.parametrize("answer", [b"9.9E+37\n", b"9.900000E+37\n", b"-9.9E+37\n"])
def test_over_range_is_a_saturated_detector(meter, until, answer):
    _, meter = meter(changes={b"MEAS:POW?": answer, b"FETC?": answer})
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    with pytest.raises(DeviceFaultError, match="meter: the detector was saturated"):
        meter.power_w()


@pytest.mark.parametrize("answer", [b"nan\n", b"INF\n", b"\n", b"1.0E-3,2.0E-3\n", b"THORLABS\n", b"\xff\n"])
def test_garbage_reading_is_refused(meter, until, answer):
    _, meter = meter(changes={b"MEAS:POW?": answer})
    meter.start_reading(0.03)
    with pytest.raises(ReplyError, match=r"meter: the answer to 'MEAS:POW\?'"):
        until(lambda: not meter.is_reading())
    with pytest.raises(ReplyError, match="meter: there is no finished reading"):
        meter.power_w()


def test_wavelength_is_set_and_read_back(meter):
    peer, meter = meter()
    meter.set_wavelength_nm(550)
    assert peer.commands == [b"SENS:CORR:WAV? MIN", b"SENS:CORR:WAV? MAX", b"SENS:CORR:WAV 550", b"SENS:CORR:WAV?"]


@pytest.mark.parametrize("wavelength_nm", [399.0, 1101.0, float("nan")])
def test_wavelength_outside_the_calibration_is_refused(meter, wavelength_nm):
    peer, meter = meter()
    with pytest.raises(LimitError, match="calibrated from 400 to 1100 nm"):
        meter.set_wavelength_nm(wavelength_nm)
    assert not [command for command in peer.commands if command.startswith(b"SENS:CORR:WAV ")]


def test_wavelength_that_the_meter_does_not_hold_is_refused(meter):
    _, meter = meter()
    with pytest.raises(DeviceFaultError, match="with 550, which is not the 633 nm that it was told"):
        meter.set_wavelength_nm(633)


def test_meter_that_was_switched_off_is_set_up_again(meter, until):
    peer, meter = meter()
    meter.connect()
    meter.set_wavelength_nm(550)
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    peer.vanish()
    with pytest.raises(NotConnectedError, match="meter: the link on port"):
        until(lambda: bool(meter.start_reading(0.03)))
    sent = len(peer.commands)
    meter.reconnect()
    assert meter.connect() == ()
    with pytest.raises(ReplyError, match="there is no finished reading"):
        meter.power_w()
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    assert {b"SENS:POW:UNIT W", b"SENS:POW:RANG:AUTO 1", b"SENS:CORR:WAV 550", b"SENS:AVER 10"} <= set(
        peer.commands[sent:]
    )
    assert meter.power_w() == 1.234205e-3


def test_meter_that_is_checked_again_over_the_same_link_is_set_up_again(meter, until):
    """It may have been switched off while the link of another device was lost."""
    peer, meter = meter()
    meter.connect()
    meter.set_wavelength_nm(550)
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    sent = len(peer.commands)
    meter.connect()
    meter.start_reading(0.03)
    until(lambda: not meter.is_reading())
    assert {b"SENS:POW:UNIT W", b"SENS:POW:RANG:AUTO 1", b"SENS:CORR:WAV 550", b"SENS:AVER 10"} <= set(
        peer.commands[sent:]
    )


def test_another_meter_on_the_port_is_not_taken_for_the_one_before(meter):
    first, other = b"THORLABS,PM100D,P0012345,2.8.0\n", b"THORLABS,PM100D,P0054321,2.8.0\n"
    peer, meter = meter(changes={b"*IDN?": [first, first, other]})
    meter.connect()
    meter.reconnect()
    with pytest.raises(DeviceFaultError, match=r"meter: another device answers .*P0054321.* before .*P0012345"):
        meter.connect()
    assert peer.commands[-1] == b"*IDN?", "it was told nothing"
