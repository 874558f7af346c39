"""A camera's run that was cut off: every picture belongs to one reading, and the maps are whole afterwards."""

import json
import signal
import subprocess
import sys
from collections import Counter

import h5py
import numpy as np
import pytest

from acquisition.imaging.frame_files import load_frame
from acquisition.journal import FILE_NAME, Journal
from goniometer.resume_run import resume

CUT_AFTER = 7
"""Readings; the point in hand has five, with its dark one."""


def cut_off(command, ends, root):
    """Run a command until it has stored so many readings, and end it."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=root) as process:
        stored = 0
        for line in process.stdout:
            stored += json.loads(line)["event"] == "ReadingStored"
            if stored == CUT_AFTER:
                process.send_signal(ends)
                break
        process.stdout.read()
        return process.wait(30)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
@pytest.mark.parametrize(("ends", "speed"), [("SIGKILL", "max"), ("SIGINT", "5")])
def test_a_run_that_was_cut_off_is_whole_once_it_was_resumed(camera_recipe, tmp_path, pytestconfig, ends, speed):
    out = tmp_path / "runs"
    arguments = ["run", camera_recipe(), "--out", out, "--speed", speed, "--json"]
    command = [sys.executable, "-m", "goniometer", *map(str, arguments)]
    code = cut_off(command, getattr(signal, ends), pytestconfig.rootpath)
    assert code == (-signal.SIGKILL if ends == "SIGKILL" else 130)
    (run,) = out.iterdir()
    (run / "frames").joinpath("000099.png").write_bytes(b"of a reading that never came into the journal")
    resume(run, speed="max", live_fit=False)
    with Journal.open(run / FILE_NAME) as stored:
        readings, frames = stored.readings(), stored.frames()
    assert len(readings) == 15
    assert {len(of_reading) for of_reading in frames} == {2}
    files = [frame.file for of_reading in frames for frame in of_reading]
    assert max(Counter(files).values()) == 1
    assert "frames/000099.png" not in files
    assert files[-1] > "frames/000100.png"
    for of_reading in frames:  # none was overwritten: each is what its reading has seen
        assert [round(load_frame(run, frame).exposure_s, 6) for frame in of_reading] == [0.2, 0.02]
    with h5py.File(run / "scan.nxs") as file:
        light = file["entry/maps/S0"][()]
    assert light.shape == (3, 72, 96)
    assert np.isfinite(light).mean() > 0.999
    assert (np.diff(light[:, 30:42, 40:56].mean(axis=(1, 2))) > 0).all()


LIMITED = """
import resource, sys
import acquisition.imaging.frame_files as files
import goniometer.cli
save = files.FrameFiles._save
def limited(self, frame):
    if self._next >= 9:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
    return save(self, frame)
files.FrameFiles._save = limited
goniometer.cli.main()
"""
"""From the tenth picture on the system lets no file grow, as a full disk would not."""


@pytest.mark.skipif(sys.platform == "win32", reason="the limit exists on POSIX only")
def test_a_full_disk_costs_the_reading_in_hand_alone(camera_recipe, tmp_path, pytestconfig):
    out = tmp_path / "runs"
    arguments = ["run", camera_recipe(exit_deg=(0, 30)), "--out", out, "--speed", "max", "--quiet"]
    command = [sys.executable, "-c", LIMITED, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=pytestconfig.rootpath, timeout=60, check=False)
    assert done.returncode == 1, done.stderr
    (run,) = out.iterdir()
    assert "frames/000009.png could not be stored: [Errno 27]" in done.stderr
    assert f"goniometer resume {run}" in done.stderr
    with Journal.open(run / FILE_NAME) as stored:
        assert len(stored.readings()) == 4
    assert not list((run / "frames").glob("*.part"))
    resume(run, speed="max", live_fit=False)
    with Journal.open(run / FILE_NAME) as stored:
        assert len(stored.readings()) == 10
    with h5py.File(run / "scan.nxs") as file:
        assert np.isfinite(file["entry/maps/S0"][()]).mean() > 0.999
