"""`goniometer compare`: the same ranking from a run, its files and a table; in words, as JSON and as a picture."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

import goniometer
from goniometer import cli
from goniometer.compare.command import EQUAL, compare_models
from goniometer.compare.panels import Line, Scan, draw_strip, quantities, scans
from goniometer.compare.plot import draw_comparison
from goniometer.compare.text import compare_text
from goniometer.errors import FitError, JournalError
from goniometer.run_folder import StoredRun
from model.geometry import in_plane
from model.literature import Hyde

ROOT = Path(__file__).resolve().parents[2]
RECIPE = ROOT / "recipes" / "iron_60deg.yaml"
PUBLISHED = ["Baek2018", "Hao2023", "Hyde", "PriestGermer", "ThreeComponent"]

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> StoredRun:
    return goniometer.run(RECIPE, out=tmp_path_factory.mktemp("runs"), speed="max", live_fit=False)


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Run `goniometer compare` with arguments; gives its exit code and what it printed."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["goniometer", "compare", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        printed = capsys.readouterr()
        return int(ended.value.code or 0), printed.out, printed.err

    return call


def a_table(
    path: Path, *, errors: bool = True, incidences_deg: tuple[float, ...] = (60.0,), step_deg: float = 4.0
) -> Path:
    """Stokes parameters of a Hyde surface, with noise."""
    rng = np.random.default_rng(0)
    lines = ["incidence_deg,exit_deg,s0_per_sr,s1_per_sr,s2_per_sr"]
    if errors:
        lines[0] += ",s0_stderr_per_sr,s1_stderr_per_sr,s2_stderr_per_sr"
    for incidence_deg in incidences_deg:
        exit_deg = np.arange(-40.0, 81.0, step_deg)
        exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
        stokes = Hyde(0.8, 0.2, 0.3, 1.6).stokes(np.radians(incidence_deg), exit_rad, azimuth_rad)[:, :3]
        stokes += 1e-3 * rng.standard_normal(stokes.shape)
        for angle_deg, row in zip(exit_deg, stokes, strict=True):
            values = [incidence_deg, angle_deg, *row, *([1e-3] * 3 if errors else [])]
            lines.append(",".join(f"{value:.9g}" for value in values))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def dolp_table(path: Path) -> Path:
    """The DoLP alone, without errors, as figures of papers show it."""
    exit_deg = np.arange(0.0, 61.0, 3.0)
    stokes = Hyde(0.8, 0.2, 0.3, 1.6).stokes(np.radians(60.0), np.radians(exit_deg), np.pi)
    dolp = np.hypot(stokes[:, 1], stokes[:, 2]) / stokes[:, 0] + 1e-3 * np.random.default_rng(0).standard_normal(21)
    rows = [f"60,{angle:g},{value:.6f}" for angle, value in zip(exit_deg, dolp, strict=True)]
    path.write_text("\n".join(["incidence_deg,exit_deg,dolp", *rows]) + "\n", encoding="utf-8")
    return path


def rows(text: str) -> list[list[str]]:
    """The table's rows, cells parted where two blanks are."""
    lines = text.split("\n\n")[1].splitlines()
    return [[cell.strip() for cell in line.split("  ") if cell.strip()] for line in lines]


def test_a_run_ranks_every_published_model_and_the_own(run: StoredRun, command: Command) -> None:
    code, out, err = command(run.folder)
    assert (code, err) == (0, "")
    header, *models = rows(out)
    assert header == ["model", "parameters", "chi²/dof", "data", "AIC", "held-out", "rms DoLP"]
    assert sorted(row[0] for row in models) == sorted([*PUBLISHED, "V-grooves, 1 bounce", "V-grooves, 3 bounces"])
    # The scene's diffuse light is hardly other than Lambert's: two models hold it.
    assert {row[0] for row in models[:3]} == {"ThreeComponent", "Hao2023", "V-grooves, 1 bounce"}
    assert [row[3] for row in models] == ["agree"] * 3 + ["refuse it"] * 4
    for name in PUBLISHED:
        assert f"\n{name} " in "\n" + out.split("\n\n")[-1]


def test_a_run_its_nexus_file_and_its_table_rank_alike(run: StoredRun) -> None:
    folder, nexus = (compare_models(run.folder / name) for name in ("", "scan.nxs"))
    table = compare_models(run.folder / "stokes.csv", RECIPE)
    for other in (nexus, table):
        for one, same in zip(folder.models, other.models, strict=True):
            assert one.candidate.name == same.candidate.name
            assert_allclose(same.aic, one.aic, rtol=1e-9)
            assert_allclose(same.held_out.deviance, one.held_out.deviance, rtol=1e-9)


def test_the_recipe_says_what_is_known_of_the_sample(run: StoredRun, tmp_path: Path) -> None:
    known = tmp_path / "fit.yaml"
    known.write_text("fit: {lobes: [specular], free: {sigma: [0.02, 1]}, fixed: {n: 2.95, k: 2.932}}\n")
    found = compare_models(run.folder, known)
    by_name = {model.candidate.name: model for model in found.models}
    assert list(by_name["Hyde"].fit.parameters) == ["sigma", "rho_s", "rho_d"]
    assert by_name["Baek2018"].fit is None
    text = compare_text(found)
    assert "Baek2018: not fitted, see below" in text
    assert "Baek2018, not fitted: It is of dielectrics, and k of this sample is known to be 2.932 or more." in text


def test_a_bare_table_says_nothing_of_the_acceptance(tmp_path: Path) -> None:
    found = compare_models(a_table(tmp_path / "table.csv"))
    names = [model.candidate.name for model in found.models]
    assert names[0] == "Hyde"
    assert sorted(names) == sorted([*PUBLISHED, "V-grooves, 1 bounce"])


def test_the_words_say_who_is_best_and_who_cannot_be_told_apart(tmp_path: Path) -> None:
    found = compare_models(a_table(tmp_path / "table.csv"))
    # Hyde's model is the three components without one of them.
    assert found.equally_good[0] == "Hyde"
    assert all(found.aic_above_best(model) <= EQUAL for model in found.models[: len(found.equally_good)])
    text = compare_text(found)
    told = "describes the data best" if len(found.equally_good) == 1 else "do not tell Hyde and ThreeComponent apart"
    assert told in text
    assert "table.csv: 31 points, 93 values of s0, s1, s2, their errors known." in text


def test_a_table_without_errors_has_no_verdict(tmp_path: Path) -> None:
    text = compare_text(compare_models(a_table(tmp_path / "table.csv", errors=False)))
    header, first, *_ = rows(text)
    assert header[2:4] == ["chi²/dof", "data"]
    assert first[0] == "Hyde"
    assert len(first) == len(header) - 2
    assert "their errors not stated" in text
    assert "refuse every model" not in text


def test_data_that_refuse_every_model_say_so(tmp_path: Path) -> None:
    table = a_table(tmp_path / "table.csv")
    lines = table.read_text().splitlines()
    table.write_text("\n".join([lines[0], *(line.replace(",0.001", ",0.0001") for line in lines[1:])]) + "\n")
    assert "The data refuse every model" in compare_text(compare_models(table))


def test_the_dolp_alone_is_enough(tmp_path: Path, command: Command) -> None:
    picture = tmp_path / "dolp.png"
    code, out, err = command(dolp_table(tmp_path / "dolp.csv"), "--plot", picture)
    assert (code, err) == (0, f"wrote {picture}\n")
    assert rows(out)[1][0] in ("Hyde", "ThreeComponent")
    assert "21 values of dolp, their errors not stated" in out
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_json_holds_what_the_table_says_and_the_fits(tmp_path: Path, command: Command) -> None:
    code, out, _ = command(a_table(tmp_path / "table.csv"), "--json")
    assert code == 0
    found = json.loads(out)
    best = found["models"][0]
    assert (best["name"], best["aic_above_best"], best["refused_by_the_data"]) == ("Hyde", 0.0, False)
    assert best["source"].startswith("Hyde et al. 2009")
    assert found["equally_good"][0] == "Hyde"
    assert set(best["fit"]["parameters"]) == {"sigma", "n", "k", "rho_s", "rho_d"}
    assert_allclose(best["aic"], best["fit"]["chi_square"] + 2 * best["parameters"], rtol=1e-12)
    assert best["held_out"]["count"] == 93
    assert (found["rows"], found["columns"], found["objective"]) == (31, ["s0", "s1", "s2"], "stokes")


def test_the_objective_of_the_command_line_counts(tmp_path: Path) -> None:
    found = compare_models(a_table(tmp_path / "table.csv", step_deg=10.0), objective="rms")
    assert found.models[0].fit.columns == ("dolp",)
    assert_allclose(found.models[0].fit.rms, found.models[0].dolp_rms, rtol=1e-9)
    assert "Compared is the degree of linear polarization, with equal weights." in compare_text(found)
    # Nothing of S0 was compared.
    assert [quantity.title for quantity in quantities(found, [])] == ["degree of linear polarization"]


def test_few_exit_angles_are_ranked_without_predictions(tmp_path: Path) -> None:
    table = a_table(tmp_path / "table.csv")
    lines = table.read_text().splitlines()
    table.write_text("\n".join([lines[0], *lines[20:24]]) + "\n")
    text = compare_text(compare_models(table))
    assert rows(text)[1][5] == "–"
    (said,) = [line for line in text.splitlines() if "not predicted" in line]
    assert said.startswith("Held-out exit angles, not predicted: 4 exit angles in table.csv: nothing was left out")


def test_data_that_no_model_can_be_fitted_to_are_refused(tmp_path: Path, command: Command) -> None:
    table = a_table(tmp_path / "table.csv")
    table.write_text("\n".join(table.read_text().splitlines()[:2]) + "\n")
    code, out, err = command(table)
    assert (code, out) == (1, "")
    assert f"No model can be fitted to {table}:\n  PriestGermer: 3 values (1 directions) cannot determine" in err


def test_a_reason_that_holds_for_all_models_is_said_once(tmp_path: Path, command: Command) -> None:
    table = tmp_path / "dark.csv"
    table.write_text("incidence_deg,exit_deg,dolp\n" + "".join(f"60,{exit_deg},0\n" for exit_deg in range(0, 60, 10)))
    code, out, err = command(table)
    assert (code, out) == (1, "")
    assert "  PriestGermer, Hyde, ThreeComponent, Baek2018, Hao2023, V-grooves, 1 bounce: All 6 rows" in err
    assert err.count("the detector was stuck, saturated or dark") == 1


def test_a_model_with_too_many_parameters_to_be_ranked_is_named(tmp_path: Path) -> None:
    table = tmp_path / "six.csv"
    rows = [
        f"60,{angle},{dolp}"
        for angle, dolp in zip(range(10, 70, 10), (0.08, 0.15, 0.22, 0.28, 0.35, 0.43), strict=True)
    ]
    table.write_text("\n".join(["incidence_deg,exit_deg,dolp", *rows]) + "\n")
    text = compare_text(compare_models(table))
    assert "Hyde: without a criterion, because 6 values without errors are too few for so many parameters." in text


def test_an_exact_fit_is_no_proof(tmp_path: Path) -> None:
    """Three directions without errors, as many values as many parameters can meet exactly."""
    table = tmp_path / "three.csv"
    table.write_text(
        "incidence_deg,exit_deg,s0_per_sr,s1_per_sr,s2_per_sr\n60,10,0.1,0.01,0\n60,20,0.2,0.03,0\n60,30,0.4,0.08,0\n"
    )
    found = compare_models(table)
    assert set(found.exact) == {"ThreeComponent", "Hao2023", "V-grooves, 1 bounce"}
    assert "leave nothing of the data but rounding: these are too few" in compare_text(found)
    noisy = compare_models(a_table(tmp_path / "table.csv", errors=False))
    assert noisy.exact == ()
    assert "but rounding" not in compare_text(noisy)


@pytest.mark.parametrize(
    ("reach", "expected"), [(2.0, [-3, 0, 3]), (29.0, [-10, -3, 0, 3, 10]), (2e5, [-1e5, -3, 0, 3, 1e5])]
)
def test_a_strip_shows_where_its_axis_becomes_logarithmic(reach: float, expected: list[float]) -> None:
    axes = Figure().add_subplot()
    residuals = np.array([-reach, -1.0, 2.0])
    exit_deg = np.array([0.0, 10.0, 20.0])
    scan = Scan(np.arange(3), exit_deg, 60.0, exit_deg, (exit_deg, exit_deg, exit_deg))
    draw_strip(axes, residuals, Line("#000000", "-"), [scan], reach)
    low, high = axes.get_ylim()
    shown = sorted(tick for tick in axes.get_yticks() if low <= tick <= high)
    assert_allclose(shown, expected)
    heights = axes.transData.transform([(0.0, tick) for tick in (0.0, 1.0, 2.0, 3.0)])[:, 1]
    assert_allclose(np.diff(heights), heights[1] - heights[0], rtol=1e-9)
    assert low < -reach < reach < high


def test_ellipsometry_of_a_smooth_sample_compares_nothing(tmp_path: Path) -> None:
    table = tmp_path / "psi.csv"
    table.write_text("incidence_deg,psi_deg,delta_deg\n60,30,170\n65,28,160\n70,26,140\n")
    with pytest.raises(FitError, match=r"psi\.csv holds psi and delta.*Nothing was compared"):
        compare_models(table)


def test_an_objective_that_the_data_do_not_allow_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FitError, match="objective normalised cannot be had"):
        compare_models(dolp_table(tmp_path / "dolp.csv"), objective="normalised")


def test_the_picture_holds_every_quantity_and_every_scan(tmp_path: Path) -> None:
    found = compare_models(a_table(tmp_path / "table.csv", incidences_deg=(30.0, 60.0)))
    parts = scans(found.given.data)
    assert_allclose([scan.incidence_deg for scan in parts], [30.0, 60.0], rtol=1e-6)
    for scan in parts:
        assert_allclose(scan.exit_deg, np.arange(-40.0, 81.0, 4.0))
    s0, dolp = quantities(found, parts)
    for scan, curve in zip(parts, s0.curves["Hyde"], strict=True):
        there = np.searchsorted(scan.curve_deg, scan.exit_deg)
        assert_allclose(curve[there], s0.models["Hyde"][scan.rows], rtol=1e-4)
        assert np.diff(scan.curve_deg).max() < 1.0
    best = found.models[0]
    assert_allclose(s0.residuals(best.candidate.name), (s0.measured - best.fit.fitted[:, 0]) / 1e-3, atol=1e-9)
    assert_allclose(np.sqrt(np.nanmean((dolp.measured - dolp.models["Hyde"]) ** 2)), best.dolp_rms, rtol=1e-12)
    picture = tmp_path / "models.png"
    draw_comparison(picture, found)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_written_is_named(tmp_path: Path, command: Command) -> None:
    code, out, err = command(a_table(tmp_path / "table.csv"), "--plot", tmp_path / "nowhere" / "models.png")
    assert code == 1
    assert "Hyde" in out
    assert "models.png cannot be written" in err
    assert "The comparison is complete without it" in err


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match=r"nothing\.csv does not exist"):
        compare_models(tmp_path / "nothing.csv")
