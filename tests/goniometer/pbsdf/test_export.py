"""A run's surface as a file for Mitsuba; whether Mitsuba reads it as it is meant is shown in tests/interop."""

import json
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from numpy.testing import assert_array_equal

import goniometer
from acquisition.journal import FILE_NAME
from goniometer.cli_runs import export
from goniometer.errors import ConfigurationError, FitError
from goniometer.export_run import export_run
from goniometer.pbsdf.axes import relative_error
from goniometer.pbsdf.export import export_pbsdf
from goniometer.pbsdf.half_angles import mueller_in_facet_frames
from goniometer.pbsdf.tensor_file import read_tensor_file

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("iron")
    content = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text())
    content |= {"exit": {"start_deg": 0, "stop_deg": 60, "step_deg": 6}, "readings": 2}
    content |= {
        name: str(ROOT / f"{name}s" / file) for name, file in (("rig", "simulated.yaml"), ("scene", "iron.yaml"))
    }
    (folder / "recipe.yaml").write_text(yaml.safe_dump(content))
    return goniometer.run(folder / "recipe.yaml", out=folder / "runs", speed="max")


@pytest.fixture(scope="module")
def exported(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("out") / "iron.pbsdf"
    return path, CliRunner().invoke(export, [str(run.folder), "--pbsdf", str(path)], catch_exceptions=False)


def test_fields_have_the_types_and_shapes_that_mitsuba_insists_on(exported):
    path, done = exported
    assert done.exit_code == 0
    fields = read_tensor_file(path)
    counts = []
    for name in ("phi_d", "theta_d", "theta_h"):
        assert fields[name].dtype == np.float32
        assert fields[name].shape[0] == 1
        counts.append(fields[name].shape[1])
    assert fields["wvls"].dtype == np.uint16
    assert_array_equal(fields["wvls"], [450, 500, 550, 600, 650])
    assert fields["M"].dtype == np.float32
    assert fields["M"].shape == (*counts, 5, 4, 4)
    assert np.isfinite(fields["M"]).all()
    assert_array_equal(fields["M"], np.broadcast_to(fields["M"][:, :, :, :1], fields["M"].shape))
    description = fields["description"].tobytes().decode()
    assert "iron at 60 degrees" in description
    assert "550 nm" in description


def test_the_file_holds_the_fitted_surface_at_its_angles(run, exported):
    fields = read_tensor_file(exported[0])
    angles = [fields[name][0].astype(float) for name in ("phi_d", "theta_d", "theta_h")]
    expected = mueller_in_facet_frames(run.fit.surface, *np.meshgrid(*angles, indexing="ij", sparse=True))
    errors = relative_error(fields["M"][:, :, :, 2], expected)
    assert np.median(errors) < 1e-6
    assert errors.max() < 1e-3  # angles are in single precision, which tells where the model is steepest


def test_the_command_says_how_well_the_table_is_interpolated(exported):
    path, done = exported
    assert f"wrote {path}: " in done.stderr
    assert "interpolation errs by 0." in done.stderr


def test_a_run_without_a_fit_has_no_surface(run, tmp_path):
    # two directions do not determine six parameters
    short = tmp_path / "short"
    short.mkdir()
    with sqlite3.connect(run.folder / FILE_NAME) as source, sqlite3.connect(short / FILE_NAME) as copy:
        source.backup(copy)
        copy.execute("DELETE FROM readings WHERE point > 0")
    with pytest.raises(FitError, match="has no fit, so there is no surface to export"):
        export_pbsdf(short, tmp_path / "a.pbsdf")
    assert not (tmp_path / "a.pbsdf").exists()


@pytest.mark.parametrize(("arguments", "fault"), [([], "Say what to write"), (["--pbsdf"], "requires an argument")])
def test_the_command_wants_to_know_what_to_write(run, arguments, fault):
    done = CliRunner().invoke(export, [str(run.folder), *arguments])
    assert done.exit_code == 2
    assert fault in done.stderr


def test_nothing_is_written_over_what_is_read(run):
    with pytest.raises(ConfigurationError, match=r"would be a \.pbsdf file"):
        export_run(run.folder, pbsdf=Path("iron.csv"))


def test_event_model_documents_go_to_a_file_or_to_the_standard_output(run, tmp_path):
    path = tmp_path / "iron.jsonl"
    assert export_run(run.folder, event_model=path) == (f"wrote {path}",)
    done = CliRunner().invoke(export, [str(run.folder), "--event-model"], catch_exceptions=False)
    assert done.stdout == path.read_text(encoding="utf-8")
    assert [json.loads(line)[0] for line in (done.stdout.splitlines()[0], done.stdout.splitlines()[-1])] == [
        "start",
        "stop",
    ]
