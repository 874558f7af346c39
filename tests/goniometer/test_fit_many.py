"""`goniometer fit` with many inputs: one table in their order, whatever becomes of some, and nothing done twice."""

from __future__ import annotations

import csv
import ctypes
import io
import json
import multiprocessing
import os
import re
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.fit_points import directions
from goniometer import cli
from goniometer.errors import ConfigurationError, JournalError
from goniometer.many_fits import fit_many
from goniometer.many_fits import workers as worker_processes
from goniometer.many_fits.progress_file import Input, ProgressFile
from goniometer.many_fits.row import CRASHED, OK, REFUSED, UNREADABLE, Asked, Row, fit_row
from goniometer.many_fits.table import write_table
from goniometer.many_fits.workers import fitted_here
from model.fit import lobe_family

ROOT = Path(__file__).resolve().parents[2]
FAMILY = lobe_family(("specular", "diffuse"), {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)})
CHOICE = """\
fit:
  lobes: [specular, diffuse]
  free: {sigma: [0.02, 1.0], n: [1.0, 6.0], k: [0.0, 8.0], exit_offset_deg: [-0.5, 0.5]}
"""
EXIT_DEG = np.arange(0.0, 61.0, 2.0)
INPUTS = 40
"""Of a run that is ended: so many that it cannot be done before."""

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "choice.yaml"
    path.write_text(CHOICE, encoding="utf-8")
    return path


@pytest.fixture
def inputs(tmp_path: Path) -> list[Path]:
    """Tables of five scans; the third is cut short, and the fifth is not there."""
    paths = [tmp_path / f"scan{number}.csv" for number in (3, 1, 4, 2, 0)]
    for number, path in enumerate(paths[:4]):
        write_scan(path, number)
    paths[2].write_text("\n".join(paths[2].read_text().splitlines()[:2]) + "\n", encoding="utf-8")
    return paths


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Inputs are fitted in this process, last first; gives those that were."""
    fitted: list[Path] = []

    def one_by_one(paths: Iterable[Path], asked: Asked, workers: int) -> Iterator[tuple[Path, Row]]:
        for path in reversed(list(paths)):
            fitted.append(path)
            yield path, fit_row(path, asked)

    monkeypatch.setattr(fit_many, "fitted_here", one_by_one)
    return fitted


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


def write_scan(path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    values = {"sigma": 0.2, "n": 2.0 + 0.1 * seed, "k": 1.5, "rho_s": 0.6, "rho_d": 0.1}
    stokes = FAMILY.seen(values).stokes(*directions(np.full(len(EXIT_DEG), 60.0), EXIT_DEG))[:, :3]
    stderr = np.full_like(stokes, 1e-4)
    stokes += stderr * random.standard_normal(stokes.shape)
    names = "s0_per_sr,s1_per_sr,s2_per_sr,s0_stderr_per_sr,s1_stderr_per_sr,s2_stderr_per_sr"
    rows = np.column_stack([np.full(len(EXIT_DEG), 60.0), EXIT_DEG, stokes, stderr])
    np.savetxt(path, rows, "%.17g", ",", header=f"incidence_deg,exit_deg,{names}", comments="", encoding="utf-8")


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def terminal() -> io.StringIO:
    return io.StringIO()


def test_the_table_has_a_row_for_each_input_in_their_order(
    inputs: list[Path], recipe: Path, here: list[Path], command: Command, tmp_path: Path
) -> None:
    out = tmp_path / "fits.csv"
    code, printed, told = command(*inputs, "--recipe", recipe, "--out", out)
    assert (code, printed) == (1, "")
    assert "5 inputs: 3 fitted, 1 refused, 1 unreadable" in told
    assert "scan4.csv: refused: 3 values (1 directions) cannot determine 6 parameters" in told
    rows = table(out)
    assert [row["path"] for row in rows] == list(map(str, inputs))
    assert [row["status"] for row in rows] == [OK, OK, REFUSED, OK, UNREADABLE]
    assert "does not exist" in rows[4]["message"]
    assert [row["sigma"] for row in rows][2::2] == ["", ""]
    for row, path in zip(rows, inputs, strict=True):
        if row["status"] == OK:
            alone = fit_row(path, Asked(recipe))
            for name, (value, stderr, at_bound) in alone["parameters"].items():
                assert float(row[name]) == value
                assert float(row[f"{name}_stderr"]) == stderr
                assert row[f"{name}_at_bound"] == str(at_bound).lower() == "false"
            assert [float(row[name]) for name in ("chi_square", "p_value", "rms")] == [
                alone[name] for name in ("chi_square", "p_value", "rms")
            ]
            assert int(row["degrees_of_freedom"]) == 93 - 6


def test_a_parquet_table_holds_the_same(inputs: list[Path], recipe: Path, here: list[Path], tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = [(path, fit_row(path, Asked(recipe))) for path in inputs]
    write_table(tmp_path / "fits.parquet", rows)
    write_table(tmp_path / "fits.csv", rows)
    found = parquet.read_table(tmp_path / "fits.parquet").to_pylist()
    texts = table(tmp_path / "fits.csv")
    assert list(found[0]) == list(texts[0])
    for row, text in zip(found, texts, strict=True):
        for name, value in row.items():
            if isinstance(value, float):
                assert float(text[name]) == value
            else:
                assert text[name] == {None: "", True: "true", False: "false"}.get(value, str(value))


def test_what_all_inputs_can_is_success_and_changes_reach_the_fit(
    inputs: list[Path], recipe: Path, here: list[Path], command: Command, tmp_path: Path
) -> None:
    out = tmp_path / "fits.csv"
    code, printed, _ = command(*inputs[:2], "--recipe", recipe, "--objective", "dolp", "--out", out)
    assert code == 0
    assert printed == f"2 inputs: 2 fitted. The table is {out}\n"
    assert [row["rho_s"] for row in table(out)] == ["1.0", "1.0"]


def test_a_table_is_written_for_one_input_too(
    inputs: list[Path], recipe: Path, here: list[Path], command: Command, tmp_path: Path
) -> None:
    assert command(inputs[0], "--recipe", recipe, "--out", tmp_path / "fits.csv")[0] == 0
    assert len(table(tmp_path / "fits.csv")) == 1


def test_what_is_done_is_not_done_again_unless_it_changed(
    inputs: list[Path], recipe: Path, here: list[Path], command: Command, tmp_path: Path
) -> None:
    asked = [*inputs, "--recipe", recipe, "--out", tmp_path / "fits.csv"]
    command(*asked)
    first = table(tmp_path / "fits.csv")
    here.clear()
    assert command(*asked)[0] == 2
    command(*asked, "--resume")
    assert here == []
    assert table(tmp_path / "fits.csv") == first
    write_scan(inputs[1], 7)
    write_scan(inputs[4], 5)
    code, _, told = command(*asked, "--resume")
    assert here == [inputs[4], inputs[1]]
    assert (code, "4 fitted, 1 refused" in told) == (1, True)
    rows = table(tmp_path / "fits.csv")
    assert [row == old for row, old in zip(rows, first, strict=True)] == [True, False, True, True, False]
    here.clear()
    os.utime(inputs[0], ns=(0, 0))
    command(*asked, "--resume")
    assert here == [inputs[0]]
    here.clear()
    command(*asked, "--resume", "--robust")
    assert len(here) == 5
    recipe.write_text(CHOICE.replace("[1.0, 6.0]", "[1.0, 5.0]"), encoding="utf-8")
    here.clear()
    command(*asked, "--resume")
    assert len(here) == 5


def test_an_earlier_run_is_neither_overwritten_nor_mixed_in_silently(
    inputs: list[Path], recipe: Path, here: list[Path], command: Command, tmp_path: Path
) -> None:
    asked = [*inputs[:2], "--recipe", recipe, "--out", tmp_path / "fits.csv"]
    (tmp_path / "fits.csv.done.jsonl").touch()  # of a run that came to nothing
    assert command(*asked)[0] == 0
    code, _, told = command(*asked)
    assert code == 2
    assert (
        "fits.csv.done.jsonl holds fits of an earlier run. Nothing was fitted. Go on with that run by --resume" in told
    )


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_glob_that_finds_the_earlier_table_goes_on(
    ending: str, inputs: list[Path], recipe: Path, here: list[Path], terminal: io.StringIO, tmp_path: Path
) -> None:
    if ending == ".parquet":
        pytest.importorskip("pyarrow")
    out = tmp_path / f"fits{ending}"
    first = fit_many.fit_files(inputs[:2], out, Asked(recipe), terminal)
    assert terminal.getvalue() == ""
    here.clear()
    found = [out, inputs[0], out.with_name(out.name + ".done.jsonl"), inputs[3], inputs[1]]
    many = fit_many.fit_files(found, out, Asked(recipe), terminal, resume=True)
    assert here == [inputs[3]]
    assert (first.counts, many.counts) == ({OK: 2}, {OK: 3})
    assert f"{out} and {out}.done.jsonl: left out" in terminal.getvalue()
    if ending == ".csv":
        assert [row["path"] for row in table(out)] == [str(inputs[number]) for number in (0, 3, 1)]
    with pytest.raises(ConfigurationError, match=r"No input is left\. Nothing was fitted"):
        fit_many.fit_files([out], out, Asked(recipe), terminal, resume=True)


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize("name", ["scan3.csv", "notes.csv", "notes.parquet", "folder.csv"])
def test_what_is_no_table_of_fits_is_not_overwritten(
    name: str, resume: bool, inputs: list[Path], recipe: Path, here: list[Path], tmp_path: Path
) -> None:
    out = tmp_path / name
    if name == "folder.csv":
        out.mkdir()
    elif name != "scan3.csv":
        if name == "notes.parquet":
            pytest.importorskip("pyarrow")
        out.write_text("path,what\nscan3.csv,dull\n", encoding="utf-8")
    before = None if out.is_dir() else out.read_bytes()
    with pytest.raises(ConfigurationError, match=rf"{name}, which is there already and is no table .* is as it was"):
        fit_many.fit_files(inputs, out, Asked(recipe), io.StringIO(), resume=resume)
    assert here == []
    assert before is None or out.read_bytes() == before
    assert not out.with_name(f"{name}.done.jsonl").exists()


def test_an_empty_file_may_become_the_table(
    inputs: list[Path], recipe: Path, here: list[Path], terminal: io.StringIO, tmp_path: Path
) -> None:
    out = tmp_path / "fits.csv"
    out.touch()
    fit_many.fit_files(inputs[:1], out, Asked(recipe), terminal)
    assert len(table(out)) == 1


def test_what_is_named_twice_is_fitted_once_and_keeps_its_places(
    inputs: list[Path], recipe: Path, here: list[Path], terminal: io.StringIO, tmp_path: Path
) -> None:
    asked = [inputs[0], inputs[1], inputs[0], inputs[3], inputs[1], inputs[0]]
    many = fit_many.fit_files(asked, tmp_path / "fits.csv", Asked(recipe), terminal)
    assert sorted(here) == sorted({inputs[0], inputs[1], inputs[3]})
    assert many.counts == {OK: 6}
    assert "3 inputs are named again; each is fitted once" in terminal.getvalue()
    rows = table(tmp_path / "fits.csv")
    assert [row["path"] for row in rows] == list(map(str, asked))
    assert rows[0] == rows[2] == rows[5] != rows[1]


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are texts elsewhere")
@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_name_that_is_no_text_has_a_row(
    ending: str, inputs: list[Path], recipe: Path, here: list[Path], terminal: io.StringIO, tmp_path: Path
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    strange, out = Path(os.fsdecode(os.fsencode(tmp_path) + b"/Gr\xf6\xdfe.csv")), tmp_path / f"fits{ending}"
    inputs[0].rename(strange)
    for resume in (False, True):
        many = fit_many.fit_files([strange, inputs[1]], out, Asked(recipe), terminal, resume=resume)
        assert many.counts == {OK: 2}
    assert len(here) == 2
    rows = table(out) if ending == ".csv" else parquet.read_table(out).to_pylist()
    assert rows[0]["path"] == f"{tmp_path}/Gr\\udcf6\\udcdfe.csv"


def test_a_cell_is_one_line_of_what_its_row_does_not_say(recipe: Path, tmp_path: Path, terminal: io.StringIO) -> None:
    write_scan(tmp_path / "good.csv", 1)
    lines = (tmp_path / "good.csv").read_text(encoding="utf-8").splitlines()
    bad = {
        "empty.csv": "",
        "header.csv": lines[0],
        "words.csv": "\n".join(
            [*lines[:4], lines[4].replace("60", "a").replace("6.", "b"), "c" + lines[5], "d" + lines[6]]
        ),
        "units.csv": "\n".join(lines).replace("incidence_deg", "incidence_rad"),
        "short.csv": "\n".join(lines[:2]),
        "dark.csv": "incidence_deg,exit_deg,s0_per_sr,s1_per_sr,s2_per_sr\n60,0,1,0,0\n60,10,2,0,0\n60,20,3,0,0\n",
        "picture.png": "",
        "scan.nxs": "no NeXus file",
        "bytes.csv": "\udcff",
    }
    for name, text in bad.items():
        (tmp_path / name).write_text(text, encoding="utf-8", errors="surrogateescape")
    (tmp_path / "folder").mkdir()
    paths = [*(tmp_path / name for name in (*bad, "folder", "missing.csv"))]
    out = tmp_path / "fits.csv"
    many = fit_many.fit_files(paths, out, Asked(recipe), terminal, workers=1)
    rows = {Path(row["path"]).name: row for row in table(out)}
    assert list(rows) == [*bad, "folder", "missing.csv"]
    assert all(row["status"] in (REFUSED, UNREADABLE) for row in rows.values())
    for row in rows.values():
        assert 0 < len(row["message"]) < 300, row
        assert "\n" not in row["message"]
        assert row["path"] not in row["message"]
        assert not re.search("Nothing was|was not used", row["message"])
        assert row["message"] == " ".join(row["message"].split())
    assert rows["units.csv"]["message"] == "line 1: column incidence_rad is not known; did you mean incidence_deg?"
    assert rows["words.csv"]["message"].startswith("line 5: column ")
    assert rows["words.csv"]["message"].endswith(" more faults")
    assert rows["dark.csv"]["message"].startswith("free: without any polarization")
    assert rows["missing.csv"]["message"].startswith("does not exist. Name a run's folder")
    assert len(str(many).splitlines()) == 1 + 5 + 1


def test_a_line_that_was_cut_off_is_done_again(inputs: list[Path], recipe: Path, tmp_path: Path) -> None:
    path, asked = tmp_path / "fits.csv.done.jsonl", Asked(recipe)
    given = [Input.now(path) for path in inputs[:3]]
    with ProgressFile(path, asked) as done:
        for one in given:
            done.keep(one, {"status": OK, "message": "Größe"})
    whole = path.read_bytes()
    for cut in (1, 5, len(whole.splitlines()[2])):
        path.write_bytes(whole[:-cut])
        with ProgressFile(path, asked) as done:
            assert [done.row(one) is None for one in given] == [False, False, True]
            done.keep(given[2], {"status": OK, "message": ""})
        with ProgressFile(path, asked) as done:
            assert all(done.row(one) for one in given)
    path.write_bytes(b"{}\n" + whole)
    with pytest.raises(JournalError, match=r"done\.jsonl, line 1, is not a stored fit\. Nothing was fitted"):
        ProgressFile(path, asked)
    path.write_bytes(b"somebody's\nnotes")
    with pytest.raises(JournalError, match=r"line 1, is not a stored fit"):
        ProgressFile(path, asked)
    assert path.read_bytes() == b"somebody's\nnotes"


def test_what_the_program_failed_on_is_tried_again(inputs: list[Path], tmp_path: Path) -> None:
    given = Input.now(inputs[0])
    with ProgressFile(tmp_path / "done.jsonl", Asked()) as done:
        done.keep(given, {"status": CRASHED, "message": "The process that fitted it died."})
        assert done.row(given) is None
        done.keep(given, {"status": OK, "message": ""})
        assert done.row(given) is not None


def test_a_full_disk_is_told_and_what_is_stored_stays(
    inputs: list[Path],
    recipe: Path,
    here: list[Path],
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(file: int) -> None:
        if len(here) == 3:
            kept = tmp_path / "fits.csv.done.jsonl"
            os.truncate(kept, kept.stat().st_size - 5)
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    asked = [*inputs, "--recipe", recipe, "--out", tmp_path / "fits.csv"]
    code, _, told = command(*asked)
    assert code == 1
    assert "cannot be written: No space left on device" in told
    assert "2 of 5 inputs are done, and stored in" in told
    assert not (tmp_path / "fits.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.csv", "b.csv"], "Many inputs become one table: name its file with --out"),
        (["a.csv", "b.csv", "--json", "--out", "t.csv"], "leave --json, --profile and --bootstrap out"),
        (["a.csv", "--workers", "2", "--scheduler", "tcp://x", "--out", "t.csv"], "exclude each other"),
        (["a.csv", "--workers", "0", "--out", "t.csv"], "0 is not in the range x>=1"),
        (["a.csv", "b.csv", "--out", "t.json"], r"is a .csv or a .parquet file"),
        (["a.csv", "b.csv", "--out", "nowhere/t.csv"], "the folder nowhere does not exist"),
        (["a.csv", "b.csv", "--out", "t.csv", "--recipe", "missing.yaml"], "missing.yaml"),
    ],
)
def test_a_command_line_that_makes_no_sense_is_refused(
    arguments: list[str], message: str, command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, told = command(*arguments)
    assert code == 2
    assert message in told
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("module", "arguments", "message"),
    [
        ("pyarrow", ["--out", "t.parquet"], "t.parquet needs pyarrow, which is not installed"),
        ("distributed", ["--out", "t.csv", "--scheduler", "tcp://127.0.0.1:1"], "--scheduler needs Dask"),
    ],
)
def test_what_is_not_installed_is_named_with_what_to_do(
    module: str,
    arguments: list[str],
    message: str,
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    code, _, told = command("a.csv", "b.csv", *arguments)
    assert code == 2
    assert message in told
    assert "pip install 'goniometer[distributed]'" in told


def test_processes_give_the_same_numbers_and_one_that_is_killed_loses_nothing(recipe: Path, tmp_path: Path) -> None:
    paths = [tmp_path / f"scan{number}.csv" for number in range(5)]
    for number, path in enumerate(paths):
        write_scan(path, number)
    asked = Asked(recipe)
    rows: dict[Path, Row] = {}
    for path, row in fitted_here(paths, asked, 2):
        if not rows:
            victim = multiprocessing.active_children()[0].pid
            assert victim is not None
            os.kill(victim, getattr(signal, "SIGKILL", signal.SIGTERM))
        rows[path] = row
    assert sorted(rows) == sorted(paths)
    for path in paths:
        alone = fit_row(path, asked)
        assert rows[path]["status"] == OK
        found, expected = (np.array([own[:2] for own in row["parameters"].values()]) for row in (rows[path], alone))
        assert_allclose(found, expected, rtol=1e-12)


def test_an_input_that_kills_its_process_harms_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    # Reads bytes at an address: at one that is nobody's it ends the process as a fault in a library would.
    monkeypatch.setattr(worker_processes, "fit_row", ctypes.string_at)
    rows = dict(fitted_here([b"first", 1, b"last"], 1, 2))  # type: ignore[list-item, arg-type]
    assert rows.pop(1)["status"] == CRASHED  # type: ignore[call-overload]
    assert rows == {b"first": b"f", b"last": b"l"}


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="waits for processes by their descriptors, as Linux has them")
@pytest.mark.parametrize("name", ["SIGINT", "SIGKILL"])
def test_a_run_that_was_ended_is_gone_on_with(name: str, recipe: Path, tmp_path: Path) -> None:
    paths = [tmp_path / f"scan{number:03}.csv" for number in range(INPUTS)]
    write_scan(paths[0], 1)
    for path in paths[1:]:
        path.write_bytes(paths[0].read_bytes())
    out, kept = tmp_path / "fits.csv", tmp_path / "fits.csv.done.jsonl"
    arguments = [sys.executable, "-m", "goniometer", "fit", *map(str, paths), "--recipe", str(recipe), "--workers", "2"]
    arguments += ["--out", str(out)]
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, cwd=ROOT, start_new_session=True) as process:
        until(process, lambda: kept.exists() and kept.read_bytes().count(b"\n") >= 3)
        listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
        workers = [os.pidfd_open(int(child)) for child in listed.split()]
        # A terminal sends Ctrl-C to the workers as well.
        os.killpg(process.pid, signal.SIGINT) if name == "SIGINT" else process.kill()
        _, told = process.communicate(timeout=60)
    for worker in workers:
        ended, _, _ = select.select([worker], [], [], 30.0)
        assert ended, "a worker lives on"
        os.close(worker)
    assert not out.exists()
    stored = kept.read_bytes().count(b"\n")
    assert 3 <= stored < INPUTS
    if name == "SIGINT":
        assert process.returncode == 130
        assert "Traceback" not in told
        assert f"{stored} of {INPUTS} inputs are done, and stored in {kept}. Go on with --resume." in told
    subprocess.run([*arguments, "--resume"], check=True, cwd=ROOT, capture_output=True)
    assert kept.read_bytes().count(b"\n") == INPUTS
    rows = table(out)
    assert [row["path"] for row in rows] == list(map(str, paths))
    assert {row["n"] for row in rows} == {rows[0]["n"]}


def test_workers_share_the_cores_and_leave_ctrl_c_to_their_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("this system cannot tell a process which cores to use")
    shares: list[list[int]] = []
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1, 2, 5})
    monkeypatch.setattr(os, "sched_setaffinity", lambda process, cores: shares.append(list(cores)))
    monkeypatch.setattr(os, "environ", {})
    handlers = {}
    monkeypatch.setattr(signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(worker_processes, "_end_with_parent", lambda: None)
    for workers in (2, 4, 6):
        shares.clear()
        started = multiprocessing.Value("i", 0)
        for _ in range(workers):
            worker_processes._prepare(started, workers)
        assert sorted({core for share in shares for core in share}) == [0, 1, 2, 5]
        assert len(shares) == workers
        assert sum(map(len, shares)) == max(4, workers)
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
    assert handlers == {signal.SIGINT: signal.SIG_IGN}


def test_a_stored_line_says_what_was_fitted(inputs: list[Path], recipe: Path, here: list[Path], tmp_path: Path) -> None:
    with (tmp_path / "terminal").open("w", encoding="utf-8") as terminal:
        fit_many.fit_files(inputs[:1], tmp_path / "fits.csv", Asked(recipe), terminal)
    line = json.loads((tmp_path / "fits.csv.done.jsonl").read_text(encoding="utf-8"))
    assert line["path"] == str(inputs[0])
    assert line["size"] == inputs[0].stat().st_size
    assert line["row"] == json.loads(json.dumps(fit_row(inputs[0], Asked(recipe))))
    assert (tmp_path / "terminal").read_text(encoding="utf-8") == ""


def test_a_recipe_with_faults_is_refused_before_anything_is_fitted(
    inputs: list[Path], recipe: Path, here: list[Path], tmp_path: Path
) -> None:
    recipe.write_text(CHOICE.replace("sigma", "sigmma"), encoding="utf-8")
    with pytest.raises(ConfigurationError, match="sigmma"):
        fit_many.fit_files(inputs, tmp_path / "fits.csv", Asked(recipe), sys.stderr)
    assert here == []
    assert not (tmp_path / "fits.csv.done.jsonl").exists()


def until(process: subprocess.Popen[str], condition: Callable[[], bool]) -> None:
    """Wait until a condition holds of a running process."""
    for _ in range(3000):
        if condition():
            return
        try:
            process.wait(timeout=0.02)
        except subprocess.TimeoutExpired:
            continue
        raise AssertionError(f"the process ended with {process.returncode}")
    raise AssertionError("the process took too long")
