"""A computer that has no time for a scan, for longer than a simulated bench is patient, changes nothing of it."""

import time
from pathlib import Path

import yaml

import goniometer
from drivers.wire.link import Link

ROOT = Path(__file__).resolve().parents[2]
STALL_S = 0.6


def test_a_scan_that_stalls_while_the_wheel_turns_reads_the_same(tmp_path, monkeypatch):
    """Positions differ from millisecond to millisecond: a bench whose time goes on alone would be noticed."""
    recipe, scene = (
        yaml.safe_load((ROOT / name).read_text().replace("../", f"{ROOT.as_posix()}/"))
        for name in ("recipes/iron_60deg.yaml", "scenes/iron.yaml")
    )
    del recipe["exit"]
    recipe |= {"exit_deg": [20, 40], "readings": 1, "scene": "scene.yaml"}
    recipe["fit"] = {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}}
    scene["effects"].append({"effect": "encoder_noise", "axis": "detector_arm", "stddev_deg": 0.0005})
    for name, content in (("recipe", recipe), ("scene", scene)):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(content))

    def readings():
        return goniometer.run(tmp_path / "recipe.yaml", out=tmp_path, speed="max", live_fit=False).readings

    expected, write, stalled = readings(), Link.write, []

    def write_and_stall(self, data):
        write(self, data)
        if data.startswith(b"pos=") and len(stalled) < 4:
            stalled.append(data)
            time.sleep(STALL_S)

    monkeypatch.setattr(Link, "write", write_and_stall)
    assert readings() == expected
    assert len(stalled) == 4
