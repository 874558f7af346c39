"""Scans take as long as `goniometer check` says, within 5 %, whatever the recipe asks for and the bench is made of."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest
import yaml

import goniometer
from acquisition.events import Event, ScanEnded, ScanStarted, StepStarted

ROOT = Path(__file__).resolve().parents[2]
DECIDE_AS_THEY_GO = {"iron_adaptive", "iron_averaging"}
SHIPPED = sorted(
    path.stem
    for path in (ROOT / "recipes").glob("*.yaml")
    if not path.stem.startswith("calibrate") and path.stem not in DECIDE_AS_THEY_GO
)
APART = [{"arms_closer_than_deg": 15.0}]

Content = dict[str, Any]


def grid(stop_deg: float, step_deg: float) -> Content:
    return {"start_deg": 0.0, "stop_deg": stop_deg, "step_deg": step_deg}


def scan(
    folder: Path, name: str, changes: Content, rig_changes: Content | None = None, analyzer: Content | None = None
) -> list[Event]:
    """Run a shipped recipe with changes on its bench, whose rig file may be changed too; gives the events."""
    recipe = yaml.safe_load((ROOT / "recipes" / f"{name}.yaml").read_text())
    rig, scene = (yaml.safe_load((ROOT / "recipes" / recipe[kind]).read_text()) for kind in ("rig", "scene"))
    rig_changes = copy.deepcopy(rig_changes or {})
    for role, more in rig_changes.pop("axes", {}).items():
        next(device for device in rig["devices"].values() if role in device.get("axes", {}))["axes"][role] |= more
    if analyzer:
        rig["devices"]["analyzer"] = analyzer
    if rig_changes:
        scene["start_deg"] = {"source_arm": 16.0}  # not in a zone
    contents = {
        "recipe": recipe | {"rig": "rig.yaml", "scene": "scene.yaml"} | changes,
        "rig": rig | rig_changes,
        "scene": scene | {"rig": "rig.yaml"},
    }
    for kind, content in contents.items():
        (folder / f"{kind}.yaml").write_text(yaml.safe_dump(content))
    return run(folder / "recipe.yaml", folder)


def run(recipe: Path, folder: Path) -> list[Event]:
    events: list[Event] = []
    goniometer.run(recipe, out=folder / "runs", speed="max", live_fit=False, subscribers=[events.append])
    return events


def off(events: list[Event]) -> float:
    """By which share a scan took longer than planned."""
    (started,) = (event for event in events if isinstance(event, ScanStarted))
    (ended,) = (event for event in events if isinstance(event, ScanEnded))
    return ended.bench_duration_s / started.expected_duration_s - 1.0


SHORT: dict[str, Content] = {
    name: {"exit": grid(20.0, 5.0)} for name in SHIPPED if name.startswith("iron") and name != "iron_points"
}


@pytest.mark.parametrize("name", [name for name in SHORT if name != "iron_imperfect_polarizers"])
def test_on_every_shipped_bench(tmp_path: Path, name: str) -> None:
    assert abs(off(scan(tmp_path, name, SHORT[name]))) < 0.05


@pytest.mark.long
@pytest.mark.parametrize("name", SHIPPED)
def test_for_every_shipped_recipe(tmp_path: Path, name: str) -> None:
    assert abs(off(run(ROOT / "recipes" / f"{name}.yaml", tmp_path))) < 0.03


@pytest.mark.parametrize(
    ("name", "changes", "rig"),
    [
        ("iron_60deg", {"exit": grid(6.0, 1.0), "readings": 1}, {"collision_zones": APART}),
        ("iron_60deg", {"exit": grid(10.0, 5.0), "direction_within_s": 0.0}, {"collision_zones": APART}),
        ("iron_incidences", {"exit": grid(60.0, 30.0), "azimuth_deg": [0, 45]}, {"collision_zones": APART}),
        ("iron_60deg", {"exit": grid(8.0, 1.0)}, {"axes": {"detector_arm": {"backlash_deg": 1.0}}}),
        ("iron_60deg", {"exit": grid(20.0, 10.0), "readings": 10, "exposure_s": 0.003}, {}),
        ("iron_60deg", {"exit": grid(20.0, 10.0), "repeats": 2, "reference": {"exit_deg": 45, "every_points": 2}}, {}),
        ("iron_mueller", {"exit": grid(20.0, 20.0), "readings": 8}, {}),
        ("iron_retarder", {"exit": grid(20.0, 5.0), "readings": 1}, {}),
    ],
    ids=["zones", "zones, turning", "zones, axes", "backlash", "brief", "references", "Mueller", "retarder"],
)
def test_where_questions_count(tmp_path: Path, name: str, changes: Content, rig: Content) -> None:
    assert abs(off(scan(tmp_path, name, changes, rig))) < 0.05


def test_on_a_slower_bench_the_time_left_is_right_after_a_third(tmp_path: Path) -> None:
    """Its wheel is slower than its rig file says."""
    analyzer = yaml.safe_load((ROOT / "rigs" / "simulated.yaml").read_text())["devices"]["analyzer"] | {"slot_s": 0.37}
    events = scan(tmp_path, "iron_60deg", {"exit": grid(60.0, 4.0), "direction_within_s": 0.0}, {}, analyzer)
    assert off(events) > 0.2
    (ended,) = (event for event in events if isinstance(event, ScanEnded))
    later = [
        event for event in events if isinstance(event, StepStarted) and event.elapsed_s > ended.bench_duration_s / 3.0
    ]
    assert len(later) > 40
    for event in later:
        truly_left_s = ended.bench_duration_s - event.elapsed_s
        assert abs(event.time_left_s - truly_left_s) < 0.05 * ended.bench_duration_s
