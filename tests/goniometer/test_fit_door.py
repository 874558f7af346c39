"""`goniometer fit`: a run, its NeXus file and its table say the same; what cannot be fitted is refused in words."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.measured_columns import KNOWN, MUELLER, STOKES, stderr_of
from acquisition.nexus import write_nexus
from acquisition.reduce import NoiseModel
from goniometer import cli
from goniometer.errors import ConfigurationError, FitError, JournalError
from goniometer.fitting.input import choice_from, fit_input, read_input, with_recipe
from goniometer.run_folder import StoredRun

ROOT = Path(__file__).resolve().parents[2]
RECIPE = ROOT / "recipes" / "iron_60deg.yaml"

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, drawing: Callable[[], AbstractContextManager[None]]) -> StoredRun:
    with drawing():
        return goniometer.run(RECIPE, out=tmp_path_factory.mktemp("runs"), speed="max", live_fit=False)


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Run `goniometer fit` with arguments; gives its exit code and what it printed."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["goniometer", "fit", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        printed = capsys.readouterr()
        return int(ended.value.code or 0), printed.out, printed.err

    return call


def table(summary: str) -> list[list[str]]:
    """Names, values and errors of a summary's parameters."""
    lines = summary.split("\n\n")[0].splitlines()[1:]
    return [line.split()[:4] for line in lines]


def test_a_run_its_nexus_file_and_its_table_give_the_same_parameters(run: StoredRun, command: Command) -> None:
    assert run.fit is not None
    shown = {}
    for path in (run.folder, run.folder / "journal.sqlite", run.folder / "scan.nxs"):
        code, out, _ = command(path)
        assert code == 0
        shown[path.name] = out
    code, out, _ = command(run.folder / "stokes.csv", "--recipe", RECIPE)
    assert code == 0
    tables = [table(text) for text in (*shown.values(), out)]
    assert [row[0] for row in tables[0]] == ["sigma", "n", "k", "rho_s", "rho_d", "rho_dd"]
    assert tables == [tables[0]] * 4
    # A NeXus file remembers the simulated sample, a table does not.
    assert "truth" in shown["scan.nxs"]
    assert "truth" not in out


def test_the_three_inputs_are_the_same_to_the_last_bit(run: StoredRun) -> None:
    folder, nexus, csv = (read_input(run.folder / name) for name in ("", "scan.nxs", "stokes.csv"))
    for other in (nexus, csv):
        for name in ("incidence_rad", "exit_rad", "azimuth_rad", "values", "covariance"):
            assert_array_equal(getattr(other.data, name), getattr(folder.data, name), err_msg=name)
    assert folder.choice == nexus.choice == run.recipe.fit
    assert folder.acceptance_sr == nexus.acceptance_sr == run.rig.calibration.acceptance_sr
    assert folder.truth == nexus.truth == run.truth
    assert (csv.choice, csv.acceptance_sr, csv.truth) == (None, None, {})
    assert [given.data.name for given in (folder, nexus, csv)] == [run.folder.name, "scan.nxs", "stokes.csv"]
    assert fit_input(nexus).values == run.fit.values == fit_input(csv, run.recipe.fit).values


def test_the_public_door_takes_what_was_read(run: StoredRun) -> None:
    data = goniometer.read(run.folder / "stokes.csv")
    assert isinstance(data, goniometer.Dataset)
    family = goniometer.SurfaceFamily(run.fit.surface, {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.5, 8.0)})
    held = goniometer.fit(data, family)
    assert_allclose(held.values["n"], run.fit.values["n"], rtol=1e-3)
    free = goniometer.fit(data, run.fit.surface)
    assert_allclose([free.values[name] for name in run.fit.values], list(run.fit.values.values()), rtol=1e-6)


def test_a_run_is_written_anew_only_as_its_own_recipe_says(run: StoredRun, command: Command, tmp_path: Path) -> None:
    names = ("stokes.csv", "scan.nxs", "fit.json", "report.png")
    times = {name: (run.folder / name).stat().st_mtime_ns for name in names}
    code, out, err = command(run.folder, "--objective", "dolp", "--out", tmp_path / "dolp.json")
    assert code == 0
    assert "Ratios of light have no scale: rho_s was held at 1" in out
    assert err == f"wrote {tmp_path / 'dolp.json'}\n"
    assert times == {name: (run.folder / name).stat().st_mtime_ns for name in names}
    written = json.loads((tmp_path / "dolp.json").read_text())
    assert (written["objective"], written["held"]) == ("dolp", {"rho_s": 1.0})
    # Weights count in the one that was held, and so does their truth.
    assert_allclose(written["parameters"]["rho_d"]["truth"], run.truth["rho_d"] / run.truth["rho_s"])
    _, _, err = command(run.folder)
    assert all(f"wrote {run.folder / name}" in err for name in names)


def test_json_holds_what_the_summary_says(run: StoredRun, command: Command, tmp_path: Path) -> None:
    recipe = tmp_path / "fit.yaml"
    recipe.write_text(
        "fit:\n"
        "  lobes: [specular, diffuse, directional]\n"
        "  free: {sigma: [0.02, 1.0], n: [1.0, 6.0], k: [0.0, 8.0], exit_offset_deg: [-1, 1]}\n"
        "  tied: {rho_dd: [rho_d, 0.5]}\n"
        "  prior: {exit_offset_deg: [0, 0.02]}\n"
    )
    code, out, _ = command(run.folder / "scan.nxs", "--recipe", recipe, "--json")
    assert code == 0
    said = json.loads(out)
    assert set(said["parameters"]["exit_offset_deg"]) == {"value", "stderr", "at_bound"}
    assert 0.005 < said["parameters"]["exit_offset_deg"]["stderr"] < 0.02
    assert said["tied"] == {"rho_dd": ["rho_d", 0.5]}
    assert said["correlation"]["names"][-1] == "exit_offset_deg"
    assert said["rows"] == 61
    assert "exit_offset_rad" not in out


def test_a_bare_file_says_what_it_was_fitted_with(run: StoredRun, command: Command) -> None:
    code, _, err = command(run.folder / "stokes.csv")
    assert code == 0
    assert "does not say what to fit. Fitted are the lobes specular, diffuse, directional, with sigma 0.01 to 2" in err
    assert "--recipe" in err


def test_robust_and_genetic_fits_end_near_the_others(run: StoredRun) -> None:
    given = read_input(run.folder / "stokes.csv")
    for changes in ({"robust": True}, {"search": "genetic"}):
        found = fit_input(given, run.recipe.fit.model_copy(update=changes))
        assert_allclose(found.values["n"], run.fit.values["n"], atol=0.5 * run.fit.parameters["n"].stderr)


def test_the_recipe_of_a_bare_file_may_bring_the_acceptance(run: StoredRun, tmp_path: Path) -> None:
    text = RECIPE.read_text(encoding="utf-8").replace("../rigs", str(ROOT / "rigs"))
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(text.replace("search: sobol", "bounces: 2"), encoding="utf-8")
    given = with_recipe(read_input(run.folder / "stokes.csv"), recipe)
    assert given.acceptance_sr == run.rig.calibration.acceptance_sr
    alone = tmp_path / "fit.yaml"
    alone.write_text(recipe.read_text(encoding="utf-8").partition("fit:")[1] + text.partition("fit:")[2])
    assert choice_from(alone) == choice_from(RECIPE)
    with pytest.raises(FitError, match="depends on the detector's acceptance, which is not known"):
        fit_input(read_input(run.folder / "stokes.csv"), given.choice)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            "fit:\n  lobes: [diffuse]\n  free: {sgima: [0.1, 1.0]}\n",
            r"\.yaml:3: key 'fit.free.sgima': .*did you mean 'sigma'",
        ),
        ("fit:\n  lobes: [diffuse]\n  free: {}\n", r"\.yaml:1: key 'fit': sigma, the rms slope .* neither in free nor"),
        ("lobes: [diffuse]\n", r"\.yaml:1: key 'fit': is missing"),
        ("fit: [\n", r"\.yaml:\d: "),
    ],
)
def test_a_recipe_that_cannot_be_used_is_refused_with_its_line(
    run: StoredRun, command: Command, tmp_path: Path, text: str, fault: str
) -> None:
    recipe = tmp_path / "fit.yaml"
    recipe.write_text(text)
    with pytest.raises(ConfigurationError, match=fault):
        choice_from(recipe)
    assert command(run.folder / "stokes.csv", "--recipe", recipe)[0] == 2


def test_options_that_do_not_go_with_the_recipe_are_refused(run: StoredRun, command: Command) -> None:
    code, _, err = command(run.folder, "--objective", "rms", "--robust")
    assert code == 2
    assert "does not go with objective rms and robust True: robust: the objective rms knows no errors" in err
    assert command(run.folder, "--objective", "mueller")[0] == 2


def test_other_files_are_refused(tmp_path: Path, command: Command) -> None:
    with pytest.raises(JournalError, match=r"nowhere\.csv does not exist. Name a run's folder, a NeXus file"):
        read_input(tmp_path / "nowhere.csv")
    with pytest.raises(JournalError, match=r"journal\.sqlite does not exist"):
        read_input(tmp_path)
    (tmp_path / "picture.png").write_bytes(b"")
    with pytest.raises(FitError, match=r"picture\.png is not something that can be fitted"):
        read_input(tmp_path / "picture.png")
    code, out, err = command(tmp_path / "picture.png")
    assert (code, out) == (1, "")
    assert "Name a run's folder, a NeXus file (.nxs" in err


NOISE = NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=550)
EXIT_DEG = range(0, 61, 3)
RNG = np.random.default_rng(5)


def dolp_table(values: Sequence[object], exit_deg: Sequence[float] = EXIT_DEG, stderr: object = 0.01) -> str:
    rows = [f"60,{angle},{value},{stderr}" for angle, value in zip(exit_deg, values, strict=True)]
    return "\n".join(["incidence_deg,exit_deg,dolp,dolp_stderr", *rows])


def stokes_table(values: np.ndarray, exit_deg: Sequence[float] = EXIT_DEG) -> str:
    rows = [f"60,{angle},{s0},{s1},{s2}" for angle, (s0, s1, s2) in zip(exit_deg, values, strict=True)]
    return "\n".join(["incidence_deg,exit_deg,s0_per_sr,s1_per_sr,s2_per_sr", *rows])


RISING = [0.2 + 0.005 * angle for angle in EXIT_DEG]


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        (dolp_table([0.0] * 21), "All 21 rows of scan.csv hold the same values"),
        (dolp_table([0.4] * 21), "All 21 rows of scan.csv hold the same values"),
        (stokes_table(np.tile([0.3, 0.1, 0.0], (21, 1))), "All 21 rows of scan.csv hold the same values"),
        (stokes_table(np.zeros((21, 3))), "All 21 rows of scan.csv hold the same values"),
        (
            stokes_table(np.outer(RISING, [1.0, 0.0, 0.0])),
            "without any polarization the data know nothing of n and k; fix them, or measure again",
        ),
        (
            stokes_table(np.array([0.3, 0.1, 0.0]) + 1e-3 * RNG.normal(size=(21, 3)), [30.0] * 21),
            "The data do not determine",
        ),
        (dolp_table([*RISING[:-1], "nan"]), "scan.csv:22: column dolp: found 'nan'"),
        (dolp_table(["inf", *RISING[1:]]), "scan.csv:2: column dolp: found 'inf'"),
        (dolp_table(RISING, stderr="nan"), "scan.csv:2: column dolp_stderr: found 'nan'"),
        (dolp_table(RISING[:3], EXIT_DEG[:3]), "3 values (3 directions) cannot determine 5 parameters"),
    ],
    ids=["no DoLP", "one DoLP", "stuck", "dark", "unpolarized", "one angle", "nan", "inf", "error nan", "few"],
)
def test_degenerate_data_are_refused(tmp_path: Path, command: Command, text: str, refusal: str) -> None:
    (tmp_path / "scan.csv").write_text(text)
    code, out, err = command(tmp_path / "scan.csv")
    assert (code, out) == (1, "")
    assert refusal in err
    assert "Nothing was fitted" in err or "No result is given" in err


def test_a_dolp_that_is_noise_about_zero_gets_a_warning(tmp_path: Path, command: Command) -> None:
    (tmp_path / "scan.csv").write_text(dolp_table(np.abs(0.01 * RNG.normal(size=21)).tolist()))
    code, out, err = command(tmp_path / "scan.csv")
    assert code == 1 or "hardly determine" in out, out + err


def test_a_model_that_misses_the_data_is_called_a_bad_fit(tmp_path: Path, command: Command) -> None:
    (tmp_path / "scan.csv").write_text(dolp_table([0.3 + 0.2 * (-1) ** (angle // 9) for angle in EXIT_DEG]))
    code, out, _ = command(tmp_path / "scan.csv")
    assert code == 1 or "this is a bad fit" in out


@pytest.mark.parametrize(
    ("change", "refusal"),
    [
        ("robust: true", "scan.csv: robust: without errors no row is far from the fit"),
        (
            "fixed: {gain: 1.0}\n  prior: {rho_d: [0.1, 0.01]}",
            "prior.rho_d: scan.csv knows weights only by their ratios",
        ),
        ("fixed: {rho_s: 1.0}", "scan.csv: free.gain: scan.csv does not depend on the gain; leave it out"),
    ],
)
def test_what_the_data_cannot_answer_is_refused(tmp_path: Path, command: Command, change: str, refusal: str) -> None:
    rows = [f"60,{angle},{value}" for angle, value in zip(EXIT_DEG, RISING, strict=True)]
    (tmp_path / "scan.csv").write_text("\n".join(["incidence_deg,exit_deg,dolp", *rows]))
    free = "sigma: [0.02, 1.0], n: [1.0, 6.0], k: [0.0, 8.0]" + ", gain: [0.5, 2.0]" * ("rho_s" in change)
    (tmp_path / "fit.yaml").write_text(f"fit:\n  lobes: [specular, diffuse]\n  free: {{{free}}}\n  {change}\n")
    code, out, err = command(tmp_path / "scan.csv", "--recipe", tmp_path / "fit.yaml")
    assert (code, out) == (1, "")
    assert refusal in err
    assert "Nothing was fitted" in err


def test_angles_of_the_instrument_are_in_degrees_in_the_nexus_file(run: StoredRun, tmp_path: Path) -> None:
    chosen = run.recipe.fit.model_copy(update={"free": {**run.recipe.fit.free, "exit_offset_deg": (-1.0, 1.0)}})
    found = fit_input(read_input(run.folder), chosen)
    path = tmp_path / "scan.nxs"
    write_nexus(path, title="iron", readings=[], points=run.points, fit=found, noise=NOISE, provenance={})
    with h5py.File(path) as file:
        parameters = file["entry/fit/parameters"]
        assert parameters["exit_offset_deg"].attrs["units"] == "deg"
        assert_allclose(np.radians(parameters["exit_offset_deg"][()]), found.values["exit_offset_rad"])
        stderr_rad = found.parameters["exit_offset_rad"].stderr
        assert_allclose(np.radians(parameters["exit_offset_deg_errors"][()]), stderr_rad)
        assert "exit_offset_rad" not in parameters
        assert b"exit_offset_deg" in list(file["entry/fit/correlation_names"])


def test_the_page_on_fits_names_every_column_and_its_example_is_valid(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "fit.md").read_text(encoding="utf-8")
    patterns = {*MUELLER[1:15], *map(stderr_of, MUELLER[1:]), *map(stderr_of, STOKES[1:])}
    columns = [name for name in KNOWN if name not in patterns and not name.startswith("cov_")]
    assert [name for name in columns if f"`{name}`" not in page] == []
    (tmp_path / "fit.yaml").write_text(page.partition("```yaml\n")[2].partition("```")[0])
    assert choice_from(tmp_path / "fit.yaml").tied == {"k": ("n", 1.0)}


def test_profile_and_bootstrap_say_intervals_in_the_units_of_the_recipe(run: StoredRun, command: Command) -> None:
    csv = run.folder / "stokes.csv"
    recipe = run.folder.parent / "offset.yaml"
    recipe.write_text(
        "fit: {lobes: [specular, diffuse, directional], free: {sigma: [0.02, 1.0], n: [1.0, 6.0], "
        "k: [0.0, 8.0], analyzer_offset_deg: [-1.0, 1.0]}}\n",
        encoding="utf-8",
    )
    wanted = ("--profile", "analyzer_offset_deg", "--bootstrap", 300)
    code, out, err = command(csv, "--recipe", recipe, *wanted, "--json")
    assert code == 0, err
    found = json.loads(out)
    estimate = found["parameters"]["analyzer_offset_deg"]
    expected = [estimate["value"] + side * 1.96 * estimate["stderr"] for side in (-1, 1)]
    atol = 0.3 * estimate["stderr"]
    assert_allclose(found["intervals"]["profiles"]["analyzer_offset_deg"], expected, atol=atol)
    assert_allclose(found["intervals"]["scatter"]["analyzer_offset_deg"], expected, atol=2.0 * atol)
    assert_allclose(found["intervals"]["scatter_stderr"]["n"], found["parameters"]["n"]["stderr"], rtol=0.2)
    code, out, _ = command(csv, "--recipe", recipe, *wanted)
    assert "analyzer_offset_deg: from" in out
    assert "300 fits to data made anew" in out
    code, _, err = command(csv, "--profile", "alpha")
    assert code == 2
    assert "--profile alpha: the fit has sigma, n, k" in err
    code, _, err = command(csv, "--profile", "n", "--robust")
    assert code == 2
    assert "no likelihood" in err


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ("until: {rho: 0.1}\ntime_limit_s: 60", r"key 'until.rho'"),
        ("until: {sigma: -1}\ntime_limit_s: 60", r"key 'until.sigma'"),
        ("adaptive: maybe\ntime_limit_s: 60", r"key 'adaptive'"),
        ("adaptive: true", r"key 'adaptive': needs a time limit"),
    ],
)
def test_a_recipe_whose_end_makes_no_sense_is_refused_as_check_does(tmp_path: Path, change: str, fault: str) -> None:
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(RECIPE.read_text(encoding="utf-8") + f"\n{change}\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=fault):
        choice_from(recipe)


def test_refusals_name_angles_of_the_instrument_as_recipes_do(tmp_path: Path, command: Command) -> None:
    rows = [f"60,{angle},{value},0,0.01,0.01" for angle, value in [(10, 0.5), (20, 0.6)]]
    header = "incidence_deg,exit_deg,s0_per_sr,s1_per_sr,s0_stderr_per_sr,s1_stderr_per_sr"
    (tmp_path / "scan.csv").write_text("\n".join([header, *rows]))
    (tmp_path / "fit.yaml").write_text(
        "fit:\n  lobes: [specular, diffuse]\n"
        "  free: {sigma: [0.02, 1.0], exit_offset_deg: [-1, 1], incidence_offset_deg: [-1, 1]}\n"
        "  fixed: {n: 2.9, k: 3.0}\n"
    )
    code, out, err = command(tmp_path / "scan.csv", "--recipe", tmp_path / "fit.yaml")
    assert (code, out) == (1, "")
    assert "exit_offset_deg" in err
    assert "_rad" not in err


def test_what_looks_wrong_in_a_table_is_said_and_kept(run: StoredRun, tmp_path: Path, command: Command) -> None:
    lines = (run.folder / "stokes.csv").read_text(encoding="utf-8").splitlines()
    path = tmp_path / "twice.csv"
    path.write_text("\n".join([*lines, lines[-1]]), encoding="utf-8")
    code, out, err = command(path, "--recipe", RECIPE, "--json")
    assert code == 0
    said = f"line {len(lines)} and line {len(lines) + 1} are the same to the last digit"
    assert said in err
    assert any(said in note for note in json.loads(out)["notes"])
    assert command(run.folder / "stokes.csv", "--recipe", RECIPE)[2] == ""
