"""The benches on which faults strike: every family of devices and every kind of port, each with a short recipe.

No detector has noise here, so that readings depend on the state of the bench alone.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from acquisition.recipe import Recipe
from goniometer.rig_file import Rig
from sim_devices.bench import Bench
from sim_devices.scene import Scene

ROOT = Path(__file__).resolve().parents[2]
ROLES = ("source_arm", "detector_arm", "sample_azimuth")
FEW = {"exit_deg": [0, 20, 30], "analyzer_deg": [0, 45, 90], "readings": 2, "exposure_s": 0.03, "dark": False}
LAMP_WATCHED = {
    "exit_deg": [0, 20],
    "analyzer_deg": [0, 45, 90, 135],
    "reference": {"exit_deg": 30, "every_points": 1},
}
SLOW = LAMP_WATCHED | {"readings": 1, "exposure_s": 0.4}
# two exposures a reading; the maps of them are not made here, they cost more than the scan
PICTURES = LAMP_WATCHED | {
    "exit_deg": [20],
    "analyzer_deg": [0, 45, 90],
    "dark": True,
    "imaging": {"exposures": [1, 0.25]},
}
BLACK_COUNTS = 200
NEAR_HOME_DEG = {"source_arm": 1.0, "detector_arm": 1.0, "sample_azimuth": 3.0, "polarizer": 5.0}
FOUR_SLOTS = {1: 0, 2: 45, 3: 90, 4: 135}

Devices = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class Kind:
    """A bench: a shipped rig and scene with other devices, and how its short recipe differs from `FEW`.

    `instead_of` and `simulated_as` replace devices of the rig and of the scene, by name; None leaves one out. A reading
    may be off by `share` of the brightest one, for what the bench does without any fault when it is asked later.
    """

    files: str
    recipe: dict[str, Any]
    instead_of: Mapping[str, dict[str, Any] | None]
    simulated_as: Mapping[str, dict[str, Any] | None]
    share: float = 0.0
    at_terminals: bool = False


def _axis(limit_deg: float, speed: float = 20, acceleration: float = 80, **more: Any) -> dict[str, Any]:
    return {
        "limits_deg": [-limit_deg, limit_deg],
        "velocity_deg_s": speed,
        "acceleration_deg_s2": acceleration,
        "settle_s": 0.05,
        "tolerance_deg": 0.03,
    } | more


def _drives(framing: str) -> tuple[Devices, Devices]:
    """Three drives of two makes on one line: what the rig and the scene hold."""
    line = {"framing": framing, "line": "rs485"}
    drive = {"driver": "oriental_az", "baudrate": 38400, "parity": "none", "port": "simulated"}
    table = {"driver": "smc_lec", "port": "simulated", "unit": 3}
    rig = {
        "source": drive | {"unit": 1, "axes": {"source_arm": _axis(85, steps_per_deg=50)}},
        "detector": drive | {"unit": 2, "axes": {"detector_arm": _axis(85, steps_per_deg=50)}},
        "sample_stage": table | {"axes": {"sample_azimuth": _axis(170, 40, 400, home_at_start=True)}},
    }
    scene = {
        "source": line | {"type": "oriental_az", "unit": 1, "axis": "source_arm", "step_deg": 0.02},
        "detector": line | {"type": "oriental_az", "unit": 2, "axis": "detector_arm", "step_deg": 0.02},
        "sample_stage": line | {"type": "smc_lec", "unit": 3, "axis": "sample_azimuth"},
    }
    return rig, scene


def _bus() -> tuple[Devices, Devices]:
    """A rotator under the sample and a slider on one Elliptec bus, and arms that DC servos turn."""
    servo = {"driver": "thorlabs_apt", "stage": "PRM1Z8", "port": "simulated"}
    module = {"port": "simulated", "settle_s": 0.05}
    rig = {
        "source": servo | {"axes": {"source_arm": _axis(85, 20, 25, home_at_start=True)}},
        "detector": servo | {"axes": {"detector_arm": _axis(85, 20, 25, home_at_start=True)}},
        "sample_stage": {
            "driver": "thorlabs_elliptec",
            "address": "2",
            "port": "simulated",
            "axes": {"sample_azimuth": _axis(180, 300, 8600, home_at_start=True, tolerance_deg=0.1)},
        },
        "analyzer": module | {"driver": "thorlabs_elliptec_slider", "address": "1", "slots": FOUR_SLOTS, "slot_s": 0.6},
    }
    turned = {"type": "thorlabs_elliptec", "model": "ELL18", "address": "2", "axis": "sample_azimuth"}
    scene = {
        "source": {"type": "thorlabs_apt", "stage": "PRM1Z8", "axes": {1: "source_arm"}},
        "detector": {"type": "thorlabs_apt", "stage": "PRM1Z8", "axes": {1: "detector_arm"}},
        "sample_stage": turned | {"line": "elliptec"},
        "analyzer": {"type": "thorlabs_elliptec_slider", "address": "1", "slots": FOUR_SLOTS, "line": "elliptec"},
    }
    return rig, scene


def _camera() -> tuple[Devices, Devices]:
    """A camera with few pixels, that costs no more than a detector without any."""
    picture = {"width_px": 32, "height_px": 24}
    rig = {
        "driver": "http_camera",
        "port": "simulated",
        "bits": 16,
        "readout_s": 0.02,
        "region": {"left": 14, "top": 10, "width": 4, "height": 4},
        "watts_per_count_per_s": 1.2e-20,
        "saturation_counts": 65000,
        "sensor": {"read_counts": 4, "electrons_per_count": 0.5, "black_counts": BLACK_COUNTS},
    }
    scene = {
        "type": "http_camera",
        "focal_px": 240,
        "distance_mm": 500,
        "acceptance_sr": 4.5e-4,
        "pixel_share": 2.5e-6,
        "joules_per_count": 1.2e-20,
        "readout_s": 0.02,
        "sensor": {"dark_counts": BLACK_COUNTS},
    }
    return {"camera": rig | picture}, {"camera": scene | picture}


# a polarizer in a rotator is within 0.1 degrees of its slot, elsewhere at each visit
_ROTATOR_SHARE = 4e-3
# a lock-in still sees 1e-4 of the light of the last slot, less when it is asked later
_LOCK_IN_SHARE = 3e-4

KINDS: dict[str, Kind] = {
    "wheel": Kind("simulated iron_noise_free", LAMP_WATCHED, {}, {}),
    "wheel, terminals": Kind("simulated iron_noise_free", {}, {}, {}, at_terminals=True),
    "slider": Kind("simulated_slider iron_slider", {}, {}, {}),
    "USB stages": Kind("simulated_thorlabs iron_thorlabs", {}, {}, {}, share=_ROTATOR_SHARE),
    "lock-in": Kind("simulated_lock_in iron_lock_in", SLOW, {}, {}, share=_LOCK_IN_SHARE),
    "drives, RTU": Kind("simulated iron_noise_free", LAMP_WATCHED, *({"arms": None} | part for part in _drives("rtu"))),
    "drives, gateway": Kind("simulated iron_noise_free", {}, *({"arms": None} | part for part in _drives("tcp"))),
    "Elliptec bus": Kind("simulated iron_noise_free", {}, *({"arms": None} | part for part in _bus())),
    "camera": Kind("simulated_camera two_materials", PICTURES, *_camera()),
}


@dataclass(frozen=True)
class ShortScan:
    """A bench with its recipe, checked."""

    name: str
    rig: Rig
    recipe: Recipe
    document: dict[str, Any]
    share: float
    at_terminals: bool

    def scene(self, faults: list[dict[str, Any]], seed: int) -> Scene:
        """The scene with faults."""
        return Scene.model_validate(self.document | {"faults": faults, "seed": seed})

    def ports(self, bench: Bench) -> dict[str, str]:
        """Where the rig's devices are reached."""
        served = {name: bench.addresses[name] for name, device in self.rig.devices.items() if device.port}
        return {name: (self.at_terminals and address.pty) or address.tcp for name, address in served.items()}


@functools.cache
def short_scan(name: str) -> ShortScan:
    """The scan on the bench of that name."""
    kind = KINDS[name]
    rig, scene = (
        yaml.safe_load((ROOT / folder / f"{file}.yaml").read_text())
        for folder, file in zip(("rigs", "scenes"), kind.files.split(), strict=True)
    )
    for document, replaced in ((rig, kind.instead_of), (scene, kind.simulated_as)):
        changed = document["devices"] | replaced
        document["devices"] = {device: entry for device, entry in changed.items() if entry}
    scene |= {"effects": [], "start_deg": {role: NEAR_HOME_DEG[role] for role in _to_home(rig)}}
    fit = {"lobes": ["specular"], "free": {"sigma": [0.02, 1.0]}, "fixed": {"n": 2.9, "k": 3.0}}
    recipe = {"recipe": name, "rig": "-", "wavelength_nm": 550, "incidence_deg": 30, "azimuth_deg": 15, "fit": fit}
    return ShortScan(
        name,
        Rig.model_validate(rig),
        Recipe.model_validate(recipe | FEW | kind.recipe),
        scene,
        kind.share,
        kind.at_terminals,
    )


def _to_home(rig: dict[str, Any]) -> list[str]:
    return [
        role
        for device in rig["devices"].values()
        for role, axis in device.get("axes", {}).items()
        if axis.get("home_at_start")
    ]
