"""Other people's clients drive the simulated devices over the wire, and take turns with our drivers on one bench."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from goniometer.assembly import connected
from goniometer.bench import served_ports, simulate
from goniometer.load_files import load_scene

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CLIENTS = ROOT / ".venv-interop" / ("Scripts" if sys.platform == "win32" else "bin") / "python"

pytestmark = pytest.mark.interop


def session(script, *addresses):
    assert CLIENTS.exists(), "the clients' environment is missing: run make interop"
    done = subprocess.run(
        [CLIENTS, HERE / script, *addresses], capture_output=True, text=True, timeout=60, cwd=HERE, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture
def scene():
    return load_scene(ROOT / "scenes" / "iron.yaml")


def test_pymeasure_drives_arms_and_meter(scene):
    with simulate(scene.scene, 50.0) as bench:
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


@pytest.mark.skipif(sys.platform == "win32", reason="MinimalModbus opens serial ports only, and Windows has no ptys")
def test_minimalmodbus_drives_the_az(scene):
    with simulate(scene.scene, 50.0) as bench:
        found = session("minimalmodbus_session.py", bench.addresses["sample_stage"].pty)
    assert found["moved"]
    assert found["in position"]
    assert found["position"] == 1500
    assert found["odd address"]
    assert "function" in found["unsupported function"].lower()
    assert found["position after ZHOME"] == 0


def test_clients_and_our_drivers_take_turns_on_one_bench(scene):
    with simulate(scene.scene, 50.0) as bench:
        for _ in range(2):
            session("pymeasure_session.py", bench.addresses["arms"].tcp, bench.addresses["meter"].tcp)
            ports = served_ports(scene.rig, bench)
            with connected(scene.rig, ports, bench.clock, 550.0) as devices:
                assert_allclose(devices.source_arm.position_deg(), 12.5, atol=1e-3)
                devices.source_arm.start_move(3.0)
                while devices.source_arm.is_moving():
                    bench.clock.sleep(0.02)
                assert_allclose(devices.source_arm.position_deg(), 3.0, atol=1e-3)
