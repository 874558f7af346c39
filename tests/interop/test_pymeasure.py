"""PyMeasure drives the ESP301, the PM100 and the SR830: its own adapter, and PyVISA with ThorlabsPM100 beside it."""

import sys

import pytest
from numpy.testing import assert_allclose

pytestmark = pytest.mark.interop

LOCK_IN_PHASE_DEG = 30.0


def test_pymeasure_drives_arms_and_meter(serve, session):
    with serve("iron") as bench:
        found = session("pymeasure_session.py", bench.addresses["arms"].tcp, bench.addresses["meter"].tcp)
    arms, meter = found["arms"], found["meter"]
    assert arms["units"] == "degree"
    assert arms["enabled"]
    assert arms["limits"][0] < 0 < arms["limits"][1]
    assert_allclose([arms["position"], arms["other position"]], [12.5, -7.25], atol=1e-3)
    assert "POSITIVE SOFTWARE LIMIT DETECTED" in arms["errors"][0]
    assert "COMMAND DOES NOT EXIST" in arms["errors"][1]
    assert_allclose(arms["position after refusal"], 12.5, atol=1e-3)
    assert meter["id"].startswith("THORLABS,PM100")
    assert meter["wavelength"] == 550
    assert 0 < meter["power"] < 1e-3


def test_pymeasure_reads_the_lock_in(serve, session):
    with serve("iron") as arms_bench, serve("stages") as bench:
        others = arms_bench.addresses["arms"].tcp, arms_bench.addresses["meter"].tcp
        found = session("pymeasure_session.py", *others, bench.addresses["lock_in"].tcp)["lock-in"]
    assert found["id"].startswith("Stanford_Research_Systems,SR830")
    assert found["settings"] == ["External", 0.03, 24, "A"]
    x, y, r, theta, frequency = found["snap"]
    assert r > 0
    assert r < found["sensitivity"]
    assert_allclose([x, y], [r * 3**0.5 / 2, r / 2], rtol=1e-3)
    assert_allclose([theta, frequency], [LOCK_IN_PHASE_DEG, 173.0], atol=1e-2)
    assert_allclose(found["outputs"], [x, y, r, theta], rtol=1e-4)
    assert found["settled"] == 0
    # output overload, and two parameters: one out of range, one unknown command
    assert found["overload"] == [4, True]
    assert found["errors"] == 0b110000
    assert found["aux"][0] == 2.5


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")
def test_pyvisa_drives_arms_meter_and_lock_in(serve, session):
    with serve("iron") as bench, serve("stages") as other:
        found = session(
            "visa_session.py",
            bench.addresses["arms"].pty,
            other.addresses["lock_in"].pty,
            bench.addresses["meter"].tcp,
        )
    assert_allclose(found["arm"]["position"], -3.75, atol=1e-3)
    assert found["arm"]["errors"] == []
    assert not found["arm"]["enabled at last"]
    meter = found["meter"]
    assert meter["sensor"].startswith("S120C,")
    assert [meter["configured"], meter["unit"], meter["average"]] == ["POW", "W", 10]
    assert meter["wavelength"] == 632.8
    assert meter["wavelengths"] == [400, 1100]
    assert 0 < meter["power"] < 1e-3
    assert meter["error"] == '0,"No error"'
    assert meter["error after nonsense"] == '-113,"Undefined header"'
    assert found["lock-in"]["both"] == [1000, 0]
    assert len(found["lock-in"]["snap"]) == 2
