"""A bench with a mirror on it, served as `goniometer simulate` does, and the rig file that reaches it."""

from contextlib import ExitStack
from pathlib import Path

import pytest
import yaml

from goniometer.bench import served_ports, simulate
from goniometer.load_files import load_scene
from sim_devices.serving.control import ControlServer

ROOT = Path(__file__).resolve().parents[3]
AXIS = {"velocity_deg_s": 20, "acceleration_deg_s2": 80, "settle_s": 0.05, "tolerance_deg": 0.005}
SLOTS = {1: "open", 2: 0, 3: 45, 4: 90, 5: 135, 6: "blocked"}
RIG = {
    "rig": "test bench",
    "devices": {
        "arms": {
            "driver": "newport_esp301",
            "port": "simulated",
            "axes": {
                "source_arm": {"axis": 1, "limits_deg": [-5, 90], **AXIS},
                "detector_arm": {"axis": 2, "limits_deg": [-85, 85], **AXIS},
                "sample_azimuth": {"axis": 3, "limits_deg": [-180, 180], **AXIS},
            },
        },
        "analyzer": {"driver": "thorlabs_fw102c", "port": "simulated", "slots": SLOTS, "slot_s": 0.5, "settle_s": 0.05},
        "meter": {
            "driver": "thorlabs_pm100",
            "port": "simulated",
            "sample_s": 0.003,
            "noise": {"read_w": 2.0e-11, "shot": True},
        },
    },
    "calibration": {"beam_power_w": 1.0e-4, "acceptance_sr": 1.0e-4},
}
NOISE = [
    {"effect": "shot_noise"},
    {"effect": "read_noise", "power_w": 2.0e-11},
    {"effect": "quantisation", "digits": 7},
]
SCENE = {
    "scene": "mirror",
    "rig": "simulated_rig.yaml",
    "seed": 1,
    "sample": {"material": "Fe", "sigma": 0.01, "rho_s": 0.7, "rho_d": 0, "rho_dd": 0},
    "lamp": {"power_w": 1.0e-4, "wavelength_nm": 550},
    "devices": {
        "arms": {"type": "newport_esp301", "axes": {1: "source_arm", 2: "detector_arm", 3: "sample_azimuth"}},
        "analyzer": {"type": "thorlabs_fw102c", "slots": SLOTS},
        "meter": {"type": "thorlabs_pm100", "acceptance_sr": 1.0e-4},
    },
}


class Served:
    """A served bench: `rig` is its rig file, `sim` the simulated bench itself."""

    def __init__(self, folder, stack, speed, loaded, zones=()):
        self.sim = stack.enter_context(simulate(loaded.scene, speed))
        control = ControlServer(self.sim, loaded.scene_text)
        stack.callback(control.stop)
        document = yaml.safe_load(loaded.rig_text) | {"bench": control.address, "collision_zones": list(zones)}
        for name, port in served_ports(loaded.rig, self.sim).items():
            document["devices"][name]["port"] = port
        self.rig = folder / "bench.yaml"
        self.rig.write_text(yaml.safe_dump(document, sort_keys=False))

    def is_moving(self):
        now_s = self.sim.clock.now()
        return any(axis.is_moving(now_s) for axis in self.sim.world.axes.values())

    def motor_deg(self, role):
        return self.sim.world.axes[role].motor_deg(self.sim.clock.now())

    def change_rig(self, change):
        """Change the rig file in place; `change` is given its content."""
        document = yaml.safe_load(self.rig.read_text())
        change(document)
        self.rig.write_text(yaml.safe_dump(document, sort_keys=False))

    def set_zones(self, *zones):
        self.change_rig(lambda rig: rig.update(collision_zones=list(zones)))

    def switch_off(self, *names):
        """Let nobody be at the ports of devices."""

        def move_away(rig):
            for number, name in enumerate(names, start=1):
                rig["devices"][name]["port"] = f"socket://127.0.0.1:{number}"

        self.change_rig(move_away)

    def change_axis(self, role, **keys):
        self.change_rig(lambda rig: rig["devices"]["arms"]["axes"][role].update(keys))


@pytest.fixture(autouse=True)
def locks_of_our_own(monkeypatch, tmp_path_factory):
    """So that tests do not meet the locks of a real bench."""
    folder = str(tmp_path_factory.mktemp("runtime"))
    monkeypatch.setattr("tempfile.tempdir", folder)
    monkeypatch.setenv("TMPDIR", folder)


@pytest.fixture
def serve(tmp_path):
    """Serve a bench; `scene` and `devices` replace parts of the scene, `effects` join its noise, `zones` the rig.

    `detector` takes the meter's place in the rig.
    """
    with ExitStack() as stack:

        def served(speed="max", scene=None, devices=None, effects=(), zones=(), detector=None):
            rig = RIG | {"devices": RIG["devices"] | ({"meter": detector} if detector else {})}
            (tmp_path / "simulated_rig.yaml").write_text(yaml.safe_dump(rig))
            content = SCENE | {"effects": [*NOISE, *effects]} | (scene or {})
            content["devices"] = content["devices"] | (devices or {})
            (tmp_path / "scene.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
            return Served(tmp_path, stack, speed, load_scene(tmp_path / "scene.yaml"), zones)

        yield served


@pytest.fixture
def serve_shipped(tmp_path):
    """Serve one of the scenes that the project brings, in virtual time."""
    with ExitStack() as stack:
        yield lambda name: Served(tmp_path, stack, "max", load_scene(ROOT / "scenes" / f"{name}.yaml"))


@pytest.fixture
def beside_the_table(serve_shipped):
    """A bench where a corner of the table may be in the way of the source arm."""
    bench = serve_shipped("iron")
    bench.set_zones({"sample_azimuth": [100, 110], "source_arm": [50, 60]})
    return bench


@pytest.fixture
def told():
    """Lines that a command has told; append is how it tells them."""
    return []


@pytest.fixture
def sent():
    """What went to each device, write by write, by a wire log."""

    def writes(log):
        found = {}
        for line in log.read_text().splitlines():
            _, _, device, direction, _, in_hex = line.split("\t")
            found.setdefault(device, []).extend([bytes.fromhex(in_hex)] * (direction == ">"))
        return found

    return writes
