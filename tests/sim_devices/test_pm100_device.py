"""The simulated PM100D understands SCPI and reads the light of its world."""

import math

import pytest
from numpy.testing import assert_allclose

from sim_devices.thorlabs_pm100 import scpi
from sim_devices.thorlabs_pm100.meter import ThorlabsPm100
from sim_devices.world import World


@pytest.fixture
def world(scene_with):
    return World(scene_with())


@pytest.fixture
def meter(world):
    return ThorlabsPm100(world)


@pytest.fixture
def pm(meter):
    return meter.session()


@pytest.fixture
def errors(ask):
    def pop_all(pm, now_s=100.0):
        numbers = []
        while (line := ask(pm, b"SYST:ERR?\n", now_s).decode()) != '0,"No error"\n':
            numbers.append(int(line.split(",")[0]))
        return numbers

    return pop_all


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"*IDN?\n", b"THORLABS,PM100D,P0012345,2.8.0\n"),
        (b"*idn?\r\n", b"THORLABS,PM100D,P0012345,2.8.0\n"),
        (b"*OPC?\n", b"1\n"),
        (b"*ESR?\n", b"128\n"),
        (b"*CLS\n*ESR?\n", b"0\n"),
        (b"*STB?\n", b"0\n"),
        (b"SYST:ERR?\n", b'0,"No error"\n'),
        (b"system:error:next?\n", b'0,"No error"\n'),
        (b":SYSTEM:ERR?\n", b'0,"No error"\n'),
        (b"SYST:SENS:IDN?\n", b"S120C,12061234,07-May-2024,1,18,33\n"),
        (b"SYSTem:SENSor:IDN?\n", b"S120C,12061234,07-May-2024,1,18,33\n"),
        (b"SENS:CORR:WAV 550\nSENSE:CORRECTION:WAVELENGTH?\n", b"5.5E+02\n"),
        (b"SENS:CORR:WAV? MIN\n", b"4.0E+02\n"),
        (b"SENS:CORR:WAV? MAXimum\n", b"1.1E+03\n"),
        (b"SENS:CORR:WAV MAX\nSENS:CORR:WAV?\n", b"1.1E+03\n"),
        (b"SENS:AVER?\n", b"1\n"),
        (b"SENS:AVER:COUN 100\nSENS:AVER:COUNT?\n", b"100\n"),
        (b"SENS:AVER 12;COUN?\n", None),
        (b"SENS:AVER:COUN 12;COUN?\n", b"12\n"),
        (b"SENS:AVER 12;:SENS:AVER?\n", b"12\n"),
        (b"SENS:CORR:WAV 600;WAV?;LOSS?\n", b"6.0E+02;0.0E+00\n"),
        (b"*IDN?;*OPC?\n", b"THORLABS,PM100D,P0012345,2.8.0;1\n"),
        (b"SENS:POW:UNIT?\n", b"W\n"),
        (b"SENS:POW:DC:UNIT dbm\nSENS:POW:UNIT?\n", b"DBM\n"),
        (b"SENS:POW:RANG:AUTO?\n", b"1\n"),
        (b"SENS:POW:RANG 3e-4\nSENS:POW:RANG:UPP?\n", b"5.0E-04\n"),
        (b"SENS:POW:RANG 3e-4\nSENS:POW:RANG:AUTO?\n", b"0\n"),
        (b"SENS:POW:RANG 3e-4\nSENS:POW:RANG:AUTO ON\nSENS:POW:RANG:AUTO?\n", b"1\n"),
        (b"SENS:POW:RANG? MIN\n", b"5.0E-08\n"),
        (b"SENS:POW:RANG? MAX\n", b"5.0E-02\n"),
        (b"SENS:CORR:LOSS 3\nSENS:CORR?\n", b"3.0E+00\n"),
        (b"INP:FILT 1\nINPUT:FILTER?\n", b"1\n"),
        (b"SENS:CORR:COLL:ZERO:STAT?\n", b"0\n"),
        (b"SENS:CORR:COLL:ZERO:MAGN?\n", b"0.0E+00\n"),
        (b"CONF:POW\n*OPC?\n", b"1\n"),
        (b"\n\r\n*OPC?\n", b"1\n"),
    ],
)
def test_commands_are_answered(pm, feed, command, answer):
    assert b"".join(text for _, text in feed(pm, command, trailing=b"*ID")) == (answer or b"")


@pytest.mark.parametrize(
    ("command", "number"),
    [
        (b"HELLO?", -113),
        (b"MEASU:POW?", -113),
        (b"MEA:POW?", -113),
        (b"SENS:CORR:WAVE 550", -113),
        (b"SENS2:CORR:WAV 550", -113),
        (b"SENS:AVER 5;SENS:AVER?", -113),
        (b"MEAS:POW", -113),
        (b"SENS:CORR:WAV", -109),
        (b"SENS:AVER 5,6", -108),
        (b"READ? 5", -108),
        (b"*RST 1", -108),
        (b"SENS:CORR:WAV red", -104),
        (b"SENS:CORR:WAV 399", -222),
        (b"SENS:CORR:WAV nan", -222),
        (b"SENS:AVER 0", -222),
        (b"SENS:AVER 3001", -222),
        (b"SENS:POW:RANG 1", -222),
        (b"SENS:POW:UNIT V", -224),
        (b"INP:FILT 2", -224),
        (b"SENS:CORR:WAV? 5", -224),
        (b"FETC?", -230),
        (b"MEAS:TEMP?", -241),
        (b"*OPC?" + b" " * 300, -363),
    ],
)
def test_refusals_are_silent_and_queued(pm, feed, errors, command, number):
    assert feed(pm, command + b"\n") == []
    assert errors(pm) == [number]


def test_errors_show_in_the_status_registers(pm, ask):
    ask(pm, b"*CLS\nHELLO?\nSENS:AVER 0\n")
    assert ask(pm, b"*STB?\n*ESR?\n") == b"4\n48\n"
    assert ask(pm, b"*ESR?\n") == b"0\n"


def test_a_full_error_queue_says_so(pm, ask, errors):
    for _ in range(12):
        ask(pm, b"HELLO?\n")
    assert errors(pm) == [-113] * 9 + [-350]


@pytest.mark.parametrize("query", [b"MEAS?", b"MEAS:POW?", b"MEASure:SCALar:POWer?", b"READ?", b"INIT;FETC?"])
def test_a_reading_is_the_power_to_the_last_bit(pm, ask, world, query):
    assert float(ask(pm, query + b"\n", 1.0)) == world.power_w(1.0)


def test_a_reading_takes_three_milliseconds_a_sample(pm):
    pm.receive(b"SENS:AVER 100\n", 0.0)
    ((due_s, _),) = pm.receive(b"MEAS:POW?\n", 10.0)
    assert_allclose(due_s, 10.3)
    ((due_s, _),) = pm.receive(b"*OPC?\n", 10.1)
    assert due_s > 10.3


def test_an_initiated_reading_is_fetched_when_it_is_ready(pm, world):
    pm.receive(b"SENS:AVER 100\n", 0.0)
    assert pm.receive(b"INIT\n", 10.0) == []
    ((due_s, later),) = pm.receive(b"FETC?\n", 10.05)
    assert_allclose(due_s, 10.3)
    ((_, first),) = later(due_s)  # virtual time does not hurry to the end of an exposure
    ((due_s, again),) = pm.receive(b"FETC?\n", 11.0)
    assert due_s < 11.01
    assert first == again
    assert float(first) == world.power_w(10.15)


def test_the_exposure_decides_the_noise(scene_with, ask):
    scene = scene_with(effects=[{"effect": "read_noise", "power_w": 1e-8}])
    pm, clear_w = ThorlabsPm100(World(scene)).session(), World(scene_with()).power_w(0.0)
    short = [float(ask(pm, b"READ?\n", time_s)) - clear_w for time_s in range(300)]
    ask(pm, b"SENS:AVER 100\n", 300)
    long = [float(ask(pm, b"READ?\n", 301 + time_s)) - clear_w for time_s in range(300)]
    rms = [math.sqrt(sum(value**2 for value in values) / 300) for values in (short, long)]
    assert_allclose(rms, [1e-8, 1e-9], rtol=0.15)


def test_a_quantised_reading_is_printed_with_its_digits(scene_with, ask):
    scene = scene_with(effects=[{"effect": "quantisation", "digits": 7}])
    printed = ask(ThorlabsPm100(World(scene)).session(), b"MEAS:POW?\n").decode()
    mantissa, exponent = printed.strip().split("E")
    assert len(mantissa.replace(".", "")) <= 7
    assert len(exponent) == 3


def test_decibels_and_attenuation(pm, ask, world):
    power_w = world.power_w(0.0)
    ask(pm, b"SENS:CORR:LOSS 10\n")
    assert_allclose(float(ask(pm, b"MEAS?\n")), 10 * power_w)
    ask(pm, b"SENS:POW:UNIT DBM\n")
    assert_allclose(float(ask(pm, b"MEAS?\n")), 10 * math.log10(power_w / 1e-3) + 10)
    world.analyzer.wheel.turn(6, 1.0, slots=6, slot_s=0.5)
    assert float(ask(pm, b"MEAS?\n", 5.0)) == 9.91e37


def test_too_much_light_for_the_range_is_over_range(pm, ask, world):
    assert world.power_w(0.0) > 5e-8
    ask(pm, b"SENS:POW:RANG MIN\n")
    assert ask(pm, b"MEAS?\n") == b"9.9E+37\n"
    ask(pm, b"SENS:POW:RANG:AUTO 1\n")
    assert float(ask(pm, b"MEAS?\n")) == world.power_w(0.0)


def test_the_zero_is_what_was_seen_in_the_dark(scene_with, ask):
    world = World(scene_with(effects=[{"effect": "dark_current", "power_w": 2e-9}]))
    world.analyzer.wheel.turn(6, 0.0, slots=6, slot_s=0.5)
    pm = ThorlabsPm100(world).session()
    ask(pm, b"SENS:CORR:COLL:ZERO\n", 10.0)
    assert ask(pm, b"SENS:CORR:COLL:ZERO:STAT?\n", 11.0) == b"1\n"
    assert float(ask(pm, b"MEAS?\n", 11.1)) == 2e-9
    assert ask(pm, b"SENS:CORR:COLL:ZERO:STAT?;MAGN?\n", 13.0) == b"0;2.0E-09\n"
    assert float(ask(pm, b"MEAS?\n", 14.0)) == 0


def test_a_zero_that_is_aborted_changes_nothing(scene_with, ask):
    pm = ThorlabsPm100(World(scene_with(effects=[{"effect": "dark_current", "power_w": 2e-9}]))).session()
    ask(pm, b"SENS:CORR:COLL:ZERO:INIT\n", 10.0)
    ask(pm, b"SENS:CORR:COLL:ZERO:ABOR\n", 11.0)
    assert ask(pm, b"SENS:CORR:COLL:ZERO:STAT?;MAGN?\n", 20.0) == b"0;0.0E+00\n"


def test_reset_restores_the_settings(pm, ask):
    ask(pm, b"SENS:AVER 50;:SENS:POW:UNIT DBM;RANG 5e-8\n*RST\n")
    assert ask(pm, b"SENS:AVER?;:SENS:POW:UNIT?;RANG:AUTO?\n") == b"1;W;1\n"


def test_settings_belong_to_the_meter_and_unfinished_lines_to_the_client(meter, ask):
    first = meter.session()
    ask(first, b"SENS:AVER 7\nSENS:AV")
    assert ask(meter.session(), b"SENS:AVER?\n") == b"7\n"
    assert ask(first, b"ER?\n") == b"7\n"


def test_headers_have_a_short_and_a_long_form_and_nothing_between():
    assert set(scpi.headers("MEASure[:SCALar]:POWer?")) == {
        f"{measure}{scalar}:{power}?"
        for measure in ("MEAS", "MEASURE")
        for scalar in ("", ":SCAL", ":SCALAR")
        for power in ("POW", "POWER")
    }


def test_a_saturated_detector_reads_over_range_and_takes_no_zero(scene_with, ask, errors):
    power_w = World(scene_with()).power_w(1.0)
    for limit_w, over_range in ((0.99 * power_w, True), (1.01 * power_w, False)):
        world = World(scene_with(effects=[{"effect": "saturation", "power_w": limit_w}]))
        pm = ThorlabsPm100(world).session()
        assert (ask(pm, b"MEAS:POW?\n", 1.0) == b"9.9E+37\n") is over_range
        ask(pm, b"SENS:CORR:COLL:ZERO\n", 2.0)
        assert errors(pm) == ([-200] if over_range else [])
