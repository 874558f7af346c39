"""A short scan with references and a lamp that drifts, cut wherever a test wants, and everything that a run leaves."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import h5py
import numpy as np
import pytest

import goniometer
from acquisition.journal import FILE_NAME, Journal
from goniometer.signals import Interruption

ROOT = Path(__file__).resolve().parents[3]
RECIPE = """
recipe: iron, in short
rig: {root}/rigs/simulated.yaml
scene: {scene}
wavelength_nm: 550
incidence_deg: 60
exit: {{start_deg: 0, stop_deg: {stop_deg}, step_deg: {step_deg}}}
analyzer_deg: [0, 45, 90, 135]
readings: {readings}
exposure_s: 0.03
{reference}
fit:
  lobes: [specular, diffuse]
  free: {{sigma: [0.02, 1.0]}}
  fixed: {{n: 2.95, k: 2.93}}
"""
REFERENCE = "reference: {exit_deg: 30, every_points: 2}"
DISTURBED = """
  - {effect: lamp_drift, relative_per_hour: 0.5}
  - {effect: lamp_walk, relative_per_root_hour: 0.05}
  - {effect: flicker, relative_amplitude: 0.01, frequency_hz: 7.3}
  - {effect: wheel_wobble, stddev_deg: 0.3}
  - {effect: encoder_noise, axis: detector_arm, stddev_deg: 0.0005}
  - {effect: backlash, axis: detector_arm, play_deg: 0.1}
"""


@pytest.fixture(scope="session")
def recipe(tmp_path_factory):
    """Writes a recipe; its scene has every effect that remembers or counts."""

    def write(step_deg=15, readings=2, effects=DISTURBED, stop_deg=60, reference=REFERENCE):
        folder = tmp_path_factory.mktemp("recipe")
        text = (ROOT / "scenes" / "iron.yaml").read_text().replace("../", f"{ROOT.as_posix()}/")
        (folder / "scene.yaml").write_text(text.rstrip() + effects)
        path = folder / "short.yaml"
        values = {"step_deg": step_deg, "readings": readings, "stop_deg": stop_deg, "reference": reference}
        path.write_text(RECIPE.format(root=ROOT.as_posix(), scene=(folder / "scene.yaml").as_posix(), **values))
        return path

    return write


@pytest.fixture(scope="session")
def whole(recipe, tmp_path_factory):
    """The folder of a run that was not interrupted."""
    return goniometer.run(recipe(), speed="max", out=tmp_path_factory.mktemp("whole"), live_fit=False).folder


@pytest.fixture(scope="session")
def noted_in():
    """Runs a recipe; gives its folder and, by key, after how many readings the journal was told of a decision."""

    def run(path, out, **options):
        noted = {}

        class Noting(Journal):
            def remember(self, key, text):
                if key.startswith("decision"):
                    noted[key] = len(self.readings())
                super().remember(key, text)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("goniometer.run_recipe.Journal", Noting)
            return goniometer.run(path, speed="max", out=out, live_fit=False, **options).folder, noted

    return run


@pytest.fixture
def cut(tmp_path):
    """Gives a copy of a run as it was after so many readings, as a kill leaves it; `unknown` are keys not noted yet."""

    def copy(run, readings, name="cut", unknown=()):
        folder = tmp_path / name
        folder.mkdir()
        shutil.copy(run / FILE_NAME, folder)
        with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
            connection.execute("DELETE FROM readings WHERE id > ?", (readings,))
            connection.executemany("DELETE FROM about WHERE key = ?", [(key,) for key in ("ended", *unknown)])
            connection.commit()
        return folder

    return copy


def _rows(run):
    """Every reading with all that is stored of it but the time of day."""
    with closing(sqlite3.connect(run / FILE_NAME)) as connection:
        names = [row[1] for row in connection.execute("PRAGMA table_info(readings)") if row[1] != "stored_at"]
        return connection.execute(f"SELECT {', '.join(names)} FROM readings ORDER BY id").fetchall()


def _nexus(run):
    """Every value in the NeXus file but the provenance and when the scan began."""
    found = {}
    with h5py.File(run / "scan.nxs") as file:

        def look(name, node):
            if isinstance(node, h5py.Dataset) and not name.startswith(("entry/provenance", "entry/start_time")):
                value = np.asarray(node[()])
                found[name] = value.tolist() if value.dtype == object else value.tobytes()  # NaN is itself in bytes

        file.visititems(look)
    return found


@pytest.fixture(scope="session")
def rows():
    return _rows


@pytest.fixture(scope="session")
def assert_same_results():
    def check(run, expected):
        assert _rows(run) == _rows(expected)
        for name in ("stokes.csv", "fit.json"):
            assert (run / name).read_bytes() == (expected / name).read_bytes(), name
        assert _nexus(run) == _nexus(expected)

    return check


@pytest.fixture
def no_results(monkeypatch):
    """Leaves out what is made of the readings of a resumed run, which takes most of the time."""
    monkeypatch.setattr("goniometer.resume_run.results", lambda folder, subscribers, interruption: None)


@pytest.fixture
def interrupted_at(monkeypatch):
    """Has a scan ended by Ctrl-C at the `number`-th look whether it should; returns how many looks there were."""

    check = Interruption.check

    def install(number):
        looks = [0]

        def counted(self):
            looks[0] += 1
            if looks[0] == number:
                self.request("Ctrl-C", 130)
            check(self)

        monkeypatch.setattr(Interruption, "check", counted)
        return looks

    return install


@pytest.fixture(scope="session")
def root():
    return ROOT
