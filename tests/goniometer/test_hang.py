"""A program that hangs is ended, and its bench stopped by another one."""

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
import yaml

from goniometer.bench import simulate
from goniometer.hang import HUNG
from goniometer.load_files import load_scene
from goniometer.run_folder import stored_run

ROOT = Path(__file__).resolve().parents[2]

HANGS = """
    import sys, threading
    import goniometer
    from acquisition.events import StepStarted

    def never(event):
        if isinstance(event, StepStarted) and event.point == 1:
            print("hangs", flush=True)
            threading.Event().wait()

    if __name__ == "__main__":
        recipe, rig, out = sys.argv[1:]
        goniometer.run(recipe, rig_path=rig or None, out=out, subscribers=[never], watchdog_s=1.0)
"""


@pytest.fixture
def program(tmp_path):
    script = tmp_path / "hangs.py"
    script.write_text(textwrap.dedent(HANGS))
    recipe = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text())
    recipe.pop("exit")
    # the arm is on its way to the second direction when the program hangs, for some 6 s
    recipe |= {"exit_deg": [0, 80], "readings": 1, "incidence_deg": 5, "direction_within_s": 0}
    for key in ("rig", "scene"):
        recipe[key] = str((ROOT / "recipes" / recipe[key]).resolve())
    (tmp_path / "recipe.yaml").write_text(yaml.safe_dump(recipe))

    def start(rig=""):
        command = [sys.executable, script, tmp_path / "recipe.yaml", rig, tmp_path / "runs"]
        return subprocess.Popen(
            [str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT
        )

    return start


def test_its_bench_is_stopped_on_its_way(program, tmp_path):
    scene = load_scene(ROOT / "scenes" / "iron.yaml")
    with simulate(scene.scene, 1.0) as bench:
        text = (
            (ROOT / "rigs" / "simulated.yaml")
            .read_text()
            .replace("[-85, 85], velocity_deg_s: 20", "[-85, 85], velocity_deg_s: 8")
        )
        for address in bench.addresses.values():
            text = text.replace("port: simulated", f"port: {address.tcp}", 1)
        rig = tmp_path / "rig.yaml"
        rig.write_text(text)
        process = program(rig)
        try:
            said, errors = process.communicate(timeout=60)  # until the process that stops the bench has ended, too
        finally:
            process.kill()
        assert process.returncode == HUNG
        assert "the program hangs" in errors
        assert "never" in errors, "where it hangs"
        assert "detector_arm: stopped" in said + errors
        assert "NOT STOPPED" not in said + errors
        first = {role: axis.motor_deg(bench.clock.now()) for role, axis in bench.world.axes.items()}
        assert 1.0 < first["detector_arm"] < 70.0
        bench.clock.sleep(0.3)
        assert {role: axis.motor_deg(bench.clock.now()) for role, axis in bench.world.axes.items()} == first


def test_a_simulated_bench_ends_with_it_and_its_readings_are_stored(program, tmp_path):
    process = program()
    try:
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == HUNG
    assert "The simulated bench ends with it" in errors
    (folder,) = (tmp_path / "runs").iterdir()
    assert len(stored_run(folder).readings) >= 5
