"""`goniometer read`: what a bench shows, and that no setting left in a device makes it show something else."""

import pytest
import serial
from numpy.testing import assert_allclose

from goniometer.bench_commands.home import home
from goniometer.bench_commands.move import move
from goniometer.bench_commands.read import read
from goniometer.errors import ConfigurationError, DeviceFaultError


def test_reading_gives_positions_slot_and_the_spread_of_readings(serve, told):
    bench = serve()
    move(bench.rig, "detector_arm", 7, told.append, told.append)
    reading = read(bench.rig, 0.1, 4, 50, told.append)
    assert reading.positions_deg == {"source_arm": 0.0, "detector_arm": 7.0, "sample_azimuth": 0.0}
    assert (reading.slot, reading.holds) == (4, 90)
    assert_allclose(reading.exposure_s, 0.099)
    assert len(reading.readings_w) == 50
    assert_allclose(reading.power_w, sum(reading.readings_w) / 50)
    # read noise of a 3 ms sample over the root of 33 samples, and photons of 3.6e-19 J
    noise_w = (2e-11**2 / 33 + reading.power_w * 3.6e-19 / 0.099) ** 0.5
    assert_allclose(reading.stddev_w, noise_w, rtol=0.35)
    assert "polarizer at 90°" in str(reading)
    assert read(bench.rig, 0.1, None, 1, told.append).stddev_w is None


def test_an_axis_that_is_not_homed_is_told_of(serve, told, monkeypatch):
    bench = serve()
    monkeypatch.setattr("drivers.newport_esp301.stage.Esp301Stage.is_homed", lambda stage: stage.name != "detector_arm")
    reading = read(bench.rig, 0.1, None, 1, told.append)
    assert reading.not_homed == ("detector_arm",)
    assert "this position means nothing" in str(reading).splitlines()[1]


def test_an_exposure_too_long_for_the_detector_is_refused(serve, told):
    bench = serve()
    with pytest.raises(ConfigurationError, match="the detector averages 9 s at most"):
        read(bench.rig, 20, None, 1, told.append)


def test_a_rig_that_no_process_serves_has_nothing_to_reach(serve, told):
    bench = serve()
    with pytest.raises(ConfigurationError, match="Serve a bench with: goniometer simulate"):
        read(bench.rig.with_name("simulated_rig.yaml"), 0.1, None, 1, told.append)


def tell(bench, device, *lines):
    """What another program has sent to a device before."""
    link = serial.serial_for_url(bench.sim.addresses[device].tcp, timeout=5)
    for line in lines:
        link.write(line)
        if line.rstrip().endswith(b"?"):
            link.readline()
    link.close()
    bench.sim.clock.sleep(1.0)


def test_a_meter_that_corrects_for_an_attenuator_is_refused_unless_the_rig_has_it(serve, told):
    bench = serve()
    before_w = read(bench.rig, 0.3, None, 1, told.append).power_w
    tell(bench, "meter", b"SENS:CORR 3\n", b"SENS:CORR?\n")
    with pytest.raises(
        DeviceFaultError, match=r"corrects its readings for an attenuator of 3 dB.*attenuation_db: 3 for"
    ):
        read(bench.rig, 0.3, None, 1, told.append)
    bench.change_rig(lambda rig: rig["devices"]["meter"].update(attenuation_db=3))
    assert_allclose(read(bench.rig, 0.3, None, 1, told.append).power_w, 10**0.3 * before_w, rtol=1e-3)


def test_settings_that_were_left_in_a_lock_in_are_set_right_and_told(serve_shipped, told):
    bench = serve_shipped("iron_lock_in")
    bench.change_rig(lambda rig: rig["devices"]["lock_in"].update(sample_s=1.0))
    before_w = read(bench.rig, 1.0, None, 1, told.append).power_w
    told.clear()
    assert_allclose(read(bench.rig, 1.0, None, 1, told.append).power_w, before_w, rtol=0.02)
    assert not [line for line in told if "lock_in" in line]
    tell(bench, "lock_in", b"OUTX 0\r", b"HARM 3\r", b"ISRC 2\r", b"OEXP 3,-100,0\r")
    assert_allclose(read(bench.rig, 1.0, None, 1, told.append).power_w, before_w, rtol=0.02)
    changed = [line.split("use: ")[1] for line in told if "lock_in" in line]
    settings = ("input I with 1 MOhm", "harmonic 3", "offset of R -100 %")
    assert [line for line in changed if "overload" not in line] == [f"{was}, which was changed" for was in settings]


def test_a_home_offset_that_other_software_has_left_is_refused(serve_shipped, told):
    bench = serve_shipped("iron_thorlabs")
    home(bench.rig, ["source_arm"], told.append, told.append, way_is_clear=False)
    offset = (45 * 49_152_000 // 360).to_bytes(4, "little")
    tell(bench, "source_stage", bytes.fromhex("40 04 0E 00 D0 01 01 00 02 00 01 00 00 00 00 01") + offset)
    with pytest.raises(DeviceFaultError, match="source_arm: its home offset is 45 degrees, and should be 4"):
        move(bench.rig, "source_arm", 5, told.append, told.append)
