"""pylablib, thorlabs-apt-device, thorlabs-elliptec and elliptec drive APT stages, Elliptec modules and the wheel."""

import sys

import pytest
from numpy.testing import assert_allclose

pytestmark = pytest.mark.interop

needs_pty = pytest.mark.skipif(
    sys.platform == "win32", reason="this client opens serial ports only, and Windows has no pseudo-terminals"
)

# a rotator misses by a few pulses, each 1/398 deg
MISS_DEG = 0.03


def test_pylablib_drives_stepper_stages(serve, session):
    with serve("stages") as bench:
        addresses = bench.addresses
        found = session("pylablib_session.py", "kinesis", addresses["unit"].tcp, "kinesis_rack", addresses["rack"].tcp)
    for stage, model in ((found["kinesis"], "K10CR1"), (found["kinesis_rack"], "BSC201")):
        assert stage["model"] == model
        assert not stage["homed at first"]
        assert stage["homed"]
        assert_allclose(stage["velocity"], [15, 8], rtol=1e-4)
        assert_allclose([stage["home"], stage["position"], stage["other position"]], [0, 12.5, -7.5], atol=1e-4)
        assert stage["jogs"]
        assert {"homed", "enabled", "settled"} <= set(stage["status after stop"])


@needs_pty
def test_thorlabs_apt_device_drives_a_servo_and_a_rack(serve, session):
    with serve("gateway") as servo, serve("stages") as rack:
        found = session("thorlabs_apt_device_session.py", servo.addresses["servo"].pty, rack.addresses["rack"].pty)
    for stage, count_deg in ((found["KDC101"], 1 / 1919.6), (found["BSC201"], 1 / 75091)):
        assert not stage["homed at first"]
        assert_allclose([stage["position"], stage["other position"]], [12.5, -7.5], atol=1.5 * count_deg)
        assert abs(stage["stopped"] + 7.5) > 1


@pytest.mark.parametrize("port", ["tcp", pytest.param("pty", marks=needs_pty)])
def test_pylablib_drives_elliptec_modules_on_one_line(serve, session, port):
    with serve("stages") as bench:
        line = getattr(bench.addresses["rotator"], port)
        assert line == getattr(bench.addresses["slider"], port)
        found = session("pylablib_session.py", "elliptec", line)["elliptec"]
    assert set(found) == {"2", "10"}
    rotator, slider = found["2"], found["10"]
    assert [rotator["type"], rotator["travel"], rotator["pulses"]] == [14, 360, 143360]
    assert_allclose(rotator["home"][1], 0, atol=MISS_DEG)
    assert [arrived for arrived, _ in rotator["moves"]] == [True, True]
    assert_allclose([position for _, position in rotator["moves"]], [45, -45], atol=MISS_DEG)
    assert rotator["velocity"] == 60
    assert [slider["type"], slider["forward"]] == [9, 0x20]
    assert [rotator["status"], slider["status"]] == ["ok", "ok"]


@needs_pty
def test_thorlabs_elliptec_drives_both_modules(serve, session):
    with serve("stages") as bench:
        found = session("thorlabs_elliptec_session.py", bench.addresses["rotator"].pty, "2", "A")
    rotator, slider = found["2"], found["A"]
    assert [rotator["model"], slider["model"]] == ["ELL14/M", "ELL9/M"]
    assert rotator["units"] == "°"
    positions = [rotator["home"], rotator["position"], rotator["other position"]]
    assert_allclose(positions, [0, 45, -45], atol=MISS_DEG)
    assert slider["position"] == 0x20
    assert "ok" in rotator["status"]


@needs_pty
def test_elliptec_drives_both_modules(serve, session):
    with serve("stages") as bench:
        found = session("elliptec_session.py", bench.addresses["rotator"].pty, "2", "A")
    assert [found["type"], found["range"], found["pulses"]] == [14, 360, 143360]
    assert_allclose(found["angles"], [45, 45, -45, -45], atol=MISS_DEG)
    assert_allclose(found["jogged"], -35, atol=MISS_DEG)
    assert 0.1 < found["motor"] < 2
    # command error, told again by the status, which forgets it
    assert found["no number"] == ["2", "GS", "3"]
    assert found["status"] == [["2", "GS", "3"], ["2", "GS", "0"]]
    address, angle_deg = found["at another address"]
    assert address == "7"
    assert_allclose(angle_deg, -35, atol=MISS_DEG)
    assert found["slots"] == [3, 3, 2, 2]


@pytest.mark.parametrize("port", ["tcp", pytest.param("pty", marks=needs_pty)])
def test_pylablib_turns_the_wheel(serve, session, port):
    with serve("iron") as bench:
        found = session("pylablib_session.py", "wheel", getattr(bench.addresses["analyzer"], port))["wheel"]
        assert bench.world.analyzer.wheel.target == 3
    assert found["slots"] == 6
    assert "FW102C" in found["id"]
    assert found["slot"] == 3
