"""A simulated bench of any devices, with their drivers connected as a rig file has them: sockets, virtual time."""

from __future__ import annotations

import copy
from contextlib import contextmanager

import pytest
import yaml

from acquisition.timing import POLL_S, READING_POLL_S
from goniometer import run_results
from goniometer.assembly import connected
from goniometer.bench import served_ports, simulate
from goniometer.load_files import load_scene

WHEEL = {1: "open", 2: 0, 3: 45, 4: 90, 5: 135, 6: "blocked"}


def axis(low=-180, high=180, speed=20, acceleration=80, **more):
    return {
        "limits_deg": [low, high],
        "velocity_deg_s": speed,
        "acceleration_deg_s2": acceleration,
        "settle_s": 0.05,
        "tolerance_deg": 0.06,
    } | more


ARMS = {"source_arm": axis(-5, 90, axis=1), "detector_arm": axis(-85, 85, axis=2)}
RIG = {
    "arms": {"driver": "newport_esp301", "axes": ARMS},
    "stage": {"driver": "oriental_az", "unit": 1, "axes": {"sample_azimuth": axis(steps_per_deg=50)}},
    "analyzer": {"driver": "thorlabs_fw102c", "slots": WHEEL, "slot_s": 0.5, "settle_s": 0.05},
    "meter": {"driver": "thorlabs_pm100", "sample_s": 0.003, "noise": {"read_w": 2e-11, "shot": True}},
}
SCENE = {
    "arms": {"type": "newport_esp301", "axes": {1: "source_arm", 2: "detector_arm"}},
    "stage": {"type": "oriental_az", "unit": 1, "axis": "sample_azimuth", "step_deg": 0.02},
    "analyzer": {"type": "thorlabs_fw102c", "slots": WHEEL},
    "meter": {"type": "thorlabs_pm100", "acceptance_sr": 1e-4},
}


class Room:
    """A simulated bench with its drivers connected, and the time between them."""

    def __init__(self, bench, devices):
        self.clock, self.world, self.addresses = bench.clock, bench.world, bench.addresses
        self.devices = devices

    def rest(self, *movers, at_most_s=60.0):
        """Poll until all have come to rest; returns how long it took."""
        begun_s = self.clock.now()
        while moving := [mover for mover in movers if mover.is_moving()]:
            self.clock.sleep(POLL_S)
            movers = moving
            assert self.clock.now() - begun_s < at_most_s
        return self.clock.now() - begun_s

    def home(self, *axes):
        for mover in axes:
            mover.start_homing()
        self.rest(*axes)

    def move(self, mover, angle_deg):
        mover.start_move(angle_deg)
        return self.rest(mover)

    def poll(self, mover, duration_s):
        end_s = self.clock.now() + duration_s
        while self.clock.now() < end_s:
            assert mover.is_moving()
            self.clock.sleep(POLL_S)

    def true_deg(self, role="sample_azimuth"):
        return self.world.axes[role].motor_deg(self.clock.now())

    def select(self, slot):
        self.devices.analyzer.start_select(slot)
        self.rest(self.devices.analyzer)
        self.clock.sleep(self.devices.analyzer.settle_s)

    def read(self, exposure_s=0.03):
        detector = self.devices.detector
        detector.start_reading(exposure_s)
        while detector.is_reading():
            self.clock.sleep(READING_POLL_S)
        return detector.power_w()

    def signal_w(self):
        return self.world.power_w(self.clock.now())


@pytest.fixture
def load(tmp_path):
    """Checks a bench of the usual devices with some of them replaced, or left out by None."""

    def checked(rig, scene, zones=(), **more):
        devices = {name: entry for name, entry in copy.deepcopy(RIG | rig).items() if entry}
        for entry in devices.values():
            if entry["driver"] != "rotating_polarizer":
                entry["port"] = "simulated"
        (tmp_path / "rig.yaml").write_text(
            yaml.safe_dump(
                {
                    "rig": "bench",
                    "devices": devices,
                    "collision_zones": list(zones),
                    "calibration": {"beam_power_w": 1e-4, "acceptance_sr": 1e-4},
                }
            )
        )
        content = {
            "scene": "iron",
            "rig": "rig.yaml",
            "seed": 1,
            "sample": {"material": "Fe", "sigma": 0.1764, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05},
            "lamp": {"power_w": 1e-4, "wavelength_nm": 550},
            "devices": {name: entry for name, entry in (SCENE | scene).items() if entry},
            "effects": [],
        }
        (tmp_path / "scene.yaml").write_text(yaml.safe_dump(content | more))
        return load_scene(tmp_path / "scene.yaml")

    return checked


@pytest.fixture
def open_room(load):
    benches = []

    def make(rig, scene, **more):
        setup = load(rig, scene, **more)
        bench = simulate(setup.scene, "max")
        served = bench.__enter__()
        benches.append(bench)
        devices = connected(setup.rig, served_ports(setup.rig, served), served.clock, 550.0)
        room = Room(served, devices.__enter__())
        benches.append(devices)
        return room

    yield make
    for bench in reversed(benches):
        bench.__exit__(None, None, None)


@pytest.fixture(scope="session")
def drawing():
    """With this, a run is drawn as it is by default."""
    draw_all = run_results._draw_all

    @contextmanager
    def drawn():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(run_results, "_draw_all", draw_all)
            yield

    return drawn


@pytest.fixture(scope="module", autouse=True)
def no_report(drawing):
    """Leaves out the picture of a run, which takes as long as its scan, unless `drawing`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_results, "_draw_all", lambda path, run: [])
        yield
