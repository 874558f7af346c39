"""Whole scans on benches of every make: what is measured is the truth, in the time that was planned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from scipy.stats import chi2

import goniometer
from acquisition.events import ScanEnded, ScanStarted
from goniometer.errors import ConfigurationError, DeviceFaultError
from goniometer.load_files import load_recipe, load_rig
from model.geometry import in_plane
from sim_devices.world import surface

ROOT = Path(__file__).resolve().parents[2]
BENCHES = ("thorlabs", "lock_in", "slider")
NOTES = {"lock_in": ("lock_in: left over from earlier use: internal reference, which was changed",)}


def variant(folder, bench, change_rig=lambda rig: None, **recipe_changes):
    """A shipped bench with another rig, and its recipe with fewer angles and other changes."""
    files = {"recipes": f"iron_{bench}.yaml", "rigs": f"simulated_{bench}.yaml", "scenes": f"iron_{bench}.yaml"}
    contents = {kind: yaml.safe_load((ROOT / kind / name).read_text()) for kind, name in files.items()}
    contents["recipes"] |= {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}} | recipe_changes
    change_rig(contents["rigs"])
    for kind, name in files.items():
        (folder / kind).mkdir()
        (folder / kind / name).write_text(yaml.safe_dump(contents[kind]))
    return folder / "recipes" / files["recipes"]


@pytest.mark.parametrize("bench", BENCHES)
def test_a_scan_measures_the_truth_in_the_time_that_was_planned(tmp_path, bench):
    events = []
    recipe = variant(tmp_path, bench)
    stored = goniometer.run(recipe, out=tmp_path / "runs", speed="max", live_fit=False, subscribers=[events.append])
    (started,) = (event for event in events if isinstance(event, ScanStarted))
    (ended,) = (event for event in events if isinstance(event, ScanEnded))
    assert started.notes == NOTES.get(bench, ())
    assert_allclose(ended.bench_duration_s, started.expected_duration_s, rtol=0.05)

    sample = surface(load_recipe(recipe).scene)
    chi_square = 0.0
    for point in stored.points:
        exit_rad, azimuth_rad = in_plane(np.radians(point.exit_deg))
        true = sample.stokes(np.radians(point.incidence_deg), float(exit_rad), float(azimuth_rad))[:3]
        off = point.stokes - true
        chi_square += off @ np.linalg.solve(point.covariance, off)
    degrees_of_freedom = 3 * len(stored.points)
    assert chi2.ppf(0.001, degrees_of_freedom) < chi_square < chi2.ppf(0.999, degrees_of_freedom)
    for name in ("sigma", "n", "k"):
        estimate = stored.fit.parameters[name]
        assert abs(estimate.value - stored.truth[name]) < 3 * estimate.stderr, name


@pytest.mark.parametrize(
    ("device", "role"),
    [("detector_stage", "detector_arm"), ("table", "sample_azimuth"), ("rotator", "polarizer")],
)
def test_a_stage_that_was_not_homed_is_not_moved(tmp_path, device, role):
    def leave_out(rig):
        rig["devices"][device]["axes"][role]["home_at_start"] = False

    recipe = variant(tmp_path, "thorlabs", leave_out, azimuth_deg=20.0)
    with pytest.raises(DeviceFaultError, match=f"{role}: the stage does not know where its zero is"):
        goniometer.run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)


def test_homing_at_the_start_and_collision_zones_exclude_each_other(tmp_path):
    def add_zones(rig):
        rig["collision_zones"] = [{"arms_closer_than_deg": 10}, {"sample_azimuth": [90, 100]}]

    variant(tmp_path, "thorlabs", add_zones)
    with pytest.raises(ConfigurationError) as caught:
        load_rig(tmp_path / "rigs" / "simulated_thorlabs.yaml")
    assert [fault.split(": ", 2)[1] for fault in caught.value.faults] == [
        "key 'collision_zones[0]'",
        "key 'collision_zones[0]'",
        "key 'collision_zones[1]'",
    ]
    for fault, role in zip(caught.value.faults, ("detector_arm", "source_arm", "sample_azimuth"), strict=True):
        assert f"leaves no safe way home for {role}" in fault


def test_a_polarizer_alone_cannot_give_dark_readings(tmp_path):
    with pytest.raises(ConfigurationError, match=r"key 'dark': needs a blocked slot, which .* does not have"):
        load_recipe(variant(tmp_path, "thorlabs", dark=True))
