"""Benches to serve, and other people's clients, each run as a program of its own in an environment of their own."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from goniometer.bench import simulate
from sim_devices.scene import Scene

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CLIENTS = ROOT / ".venv-interop" / ("Scripts" if sys.platform == "win32" else "bin") / "python"
SCENES = {"iron": ROOT / "scenes" / "iron.yaml"} | {path.stem: path for path in (HERE / "scenes").glob("*.yaml")}

# what a client waits for, it waits for in real time
SPEED = 20.0


@pytest.fixture
def serve():
    """Serve one of the scenes, at a speed, as a context that gives the addresses of its devices."""

    def bench(name, speed=SPEED):
        return simulate(Scene.model_validate(yaml.safe_load(SCENES[name].read_text(encoding="utf-8"))), speed)

    return bench


@pytest.fixture
def session():
    """Run a client's session to its end; what it has found."""
    assert CLIENTS.exists(), "the clients' environment is missing: run make interop"

    def run(script, *addresses):
        done = subprocess.run(
            [CLIENTS, HERE / script, *addresses], capture_output=True, text=True, timeout=60, cwd=HERE, check=False
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run
