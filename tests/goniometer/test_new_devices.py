"""The device that docs/devices.md brings as a package of its own is found, simulated and used in a scan."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "devices.md").read_text(encoding="utf-8")
SCAN = """
import json, sys
import goniometer
stored = goniometer.run(sys.argv[1], out=sys.argv[2], speed="max", live_fit=False)
print(json.dumps({
    "azimuths": sorted({reading.azimuth_deg for reading in stored.readings}),
    "sigma": [stored.fit.parameters["sigma"].value, stored.truth["sigma"]],
}))
"""


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def install(folder, points):
    """The package as its installer leaves it."""
    for block in blocks("python"):
        path = folder / re.match(r"# (turntable/\w+\.py)\n", block)[1]
        path.parent.mkdir(exist_ok=True)
        path.write_text(block)
    about = folder / "turntable-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: turntable\nVersion: 1.0\n")
    lines = [f"[{group}]\n" + "".join(f"{name} = {of}\n" for name, of in named.items()) for group, named in points]
    (about / "entry_points.txt").write_text("\n".join(lines))


def bench(folder):
    """The bench with a slider, short, with the new stage under its sample."""
    files = {name: f"{name}s/{of}_slider.yaml" for name, of in (("rig", "simulated"), ("scene", "iron"))}
    files["recipe"] = "recipes/iron_slider.yaml"
    contents = {name: yaml.safe_load((ROOT / path).read_text()) for name, path in files.items()}
    for name, block in zip(("rig", "scene"), blocks("yaml"), strict=True):
        contents[name]["devices"] |= yaml.safe_load(block)
    few = {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}
    contents["recipe"] |= {"azimuth_deg": 12.5, "exit": few}
    for name, path in files.items():
        (folder / path).parent.mkdir()
        (folder / path).write_text(yaml.safe_dump(contents[name]))
    return folder / files["recipe"]


def scan(recipe, folder):
    paths = [str(folder), str(ROOT)]
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", SCAN, str(recipe), str(folder / "runs")],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )


def test_the_example_of_the_documentation_is_a_device_like_any_other(tmp_path):
    (toml,) = blocks("toml")
    install(tmp_path, tomllib.loads(toml)["project"]["entry-points"].items())
    ended = scan(bench(tmp_path), tmp_path)
    assert ended.returncode == 0, ended.stderr
    told = json.loads(ended.stdout)
    assert told["azimuths"] == [12.5]
    assert told["sigma"][0] == pytest.approx(told["sigma"][1], rel=0.01)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("turntable.rig:Missing", "the package turntable offers the driver turntable, which cannot be loaded"),
        ("turntable.rig:Turntable", "which is <class 'turntable.rig.Turntable'> and no DeviceEntry"),
        ("turntable.broken:NoLiteral", "which has no name in a rig file: it needs driver: Literal"),
        ("turntable.broken:NoConnect", "turntable.broken.NoConnect'> and lacks connect"),
        ("turntable.broken:NotOurs", "which has the name of another, thorlabs_pm100"),
    ],
)
def test_a_package_whose_offer_cannot_be_used_is_named_and_stops_only_who_needs_it(tmp_path, target, message):
    install(tmp_path, [("goniometer.drivers", {"turntable": target})])
    (tmp_path / "turntable" / "broken.py").write_text(BROKEN)
    shipped, needing_it = ROOT / "rigs" / "simulated.yaml", tmp_path / "rigs" / "simulated_slider.yaml"
    bench(tmp_path)
    others = check(shipped, tmp_path)
    assert message in others.stderr
    assert (others.returncode, others.stdout) == (0, f"{shipped} is valid.\n")
    refused = check(needing_it, tmp_path)
    assert refused.returncode == 2
    assert message in refused.stderr
    assert "'devices.sample_stage.driver': got 'turntable'; allowed: " in refused.stderr


BROKEN = """
from typing import Literal
from goniometer.rig_devices.entry import DetectorEntry
from turntable.rig import TurntableEntry

class NoLiteral(TurntableEntry):
    driver: str = "turntable"

class NoConnect(DetectorEntry):
    driver: Literal["turntable"]

class NotOurs(TurntableEntry):
    driver: Literal["thorlabs_pm100"]
"""


def check(file, folder):
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "goniometer", "check", str(file)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
