"""`goniometer fit --scheduler`: a Dask cluster gives the same numbers, and loses nothing with a worker.

Dask is optional, so that these tests run where `goniometer[distributed]` is installed. The cluster listens on the
loopback interface alone, and shows no dashboard.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.fit_points import directions
from goniometer.errors import ConfigurationError, GoniometerError
from goniometer.many_fits import cluster as on_a_cluster
from goniometer.many_fits.cluster import fitted_on
from goniometer.many_fits.fit_many import fit_files
from goniometer.many_fits.row import OK, UNREADABLE, Asked, Row, fit_row
from model.fit import lobe_family

distributed = pytest.importorskip("distributed")
# Warnings of Dask and of what it is made of are not ours to heed.
pytestmark = pytest.mark.filterwarnings("default")

FAMILY = lobe_family(("specular", "diffuse"), {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)})
CHOICE = "fit: {lobes: [specular, diffuse], free: {sigma: [0.02, 1.0], n: [1.0, 6.0], k: [0.0, 8.0]}}\n"
EXIT_DEG = np.arange(0.0, 61.0, 2.0)


def local_cluster(workers: int) -> Any:
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
        silence_logs=50,
    )


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with local_cluster(2) as made:
        yield made


@pytest.fixture
def inputs(tmp_path: Path) -> list[Path]:
    """Tables of forty scans, the last of which is not there."""
    paths = [tmp_path / f"scan{number:02}.csv" for number in range(40)]
    for number, path in enumerate(paths[:-1]):
        values = {"sigma": 0.2, "n": 2.0 + 0.02 * number, "k": 1.5, "rho_s": 0.6, "rho_d": 0.1}
        stokes = FAMILY.seen(values).stokes(*directions(np.full(len(EXIT_DEG), 60.0), EXIT_DEG))[:, :3]
        rows = np.column_stack([np.full(len(EXIT_DEG), 60.0), EXIT_DEG, stokes, np.full_like(stokes, 1e-4)])
        names = "s0_per_sr,s1_per_sr,s2_per_sr,s0_stderr_per_sr,s1_stderr_per_sr,s2_stderr_per_sr"
        np.savetxt(path, rows, "%.17g", ",", header=f"incidence_deg,exit_deg,{names}", comments="")
    return paths


@pytest.fixture
def asked(tmp_path: Path) -> Asked:
    recipe = tmp_path / "choice.yaml"
    recipe.write_text(CHOICE, encoding="utf-8")
    return Asked(recipe)


def numbers(row: Row) -> list[float]:
    return [number for estimate in row["parameters"].values() for number in estimate[:2]] + [row["chi_square"]]


def test_the_numbers_are_those_of_this_machine(cluster: Any, inputs: list[Path], asked: Asked, tmp_path: Path) -> None:
    out = tmp_path / "fits.csv"
    many = fit_files(inputs, out, asked, sys.stderr, scheduler=cluster.scheduler_address)
    assert many.counts == {OK: 39, UNREADABLE: 1}
    by_cluster = out.read_text(encoding="utf-8")
    (tmp_path / "fits.csv.done.jsonl").unlink()
    fit_files(inputs, out, asked, sys.stderr, workers=1)
    assert out.read_text(encoding="utf-8") == by_cluster


def test_a_worker_that_is_killed_loses_nothing(cluster: Any, inputs: list[Path], asked: Asked) -> None:
    with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
        pids = list(client.run(os.getpid).values())
    rows: dict[Path, Row] = {}
    for path, row in fitted_on(cluster.scheduler_address, inputs, asked):
        if len(rows) == 3:
            os.kill(pids[0], getattr(signal, "SIGKILL", signal.SIGTERM))
        rows[path] = row
    assert sorted(rows) == inputs
    for path in inputs[:-1]:
        assert rows[path]["status"] == OK
        assert_allclose(numbers(rows[path]), numbers(fit_row(path, asked)), rtol=1e-12)


def test_workers_without_the_program_are_refused(
    cluster: Any, inputs: list[Path], asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(on_a_cluster, "__version__", "9.9")
    with pytest.raises(
        ConfigurationError, match=r"2 of 2 Dask workers do not have goniometer 9\.9; .*Nothing was fitted"
    ):
        list(fitted_on(cluster.scheduler_address, inputs, asked))


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("foo", r"--scheduler is 'foo'; write tcp://HOST:PORT.*Nothing was fitted"),
        ("", r"--scheduler is ''; write tcp://HOST:PORT"),
        ("http://127.0.0.1:8786", "write tcp://HOST:PORT"),
        ("tcp://127.0.0.1", "write tcp://HOST:PORT"),
        ("tls://127.0.0.1:1", r"no certificates here\. Nothing was fitted"),
    ],
)
def test_what_is_no_address_is_refused_at_once(
    address: str, message: str, inputs: list[Path], asked: Asked, tmp_path: Path
) -> None:
    with pytest.raises(ConfigurationError, match=message) as refused:
        fit_files(inputs, tmp_path / "fits.csv", asked, sys.stderr, scheduler=address)
    assert not hasattr(refused.value, "__notes__")
    assert not list(tmp_path.glob("fits*"))


def test_a_scheduler_that_is_not_there_or_has_no_workers_is_told(
    inputs: list[Path], asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(on_a_cluster, "_CONNECTED_WITHIN_S", 0.5)
    with pytest.raises(GoniometerError, match=r"scheduler tcp://127\.0\.0\.1:1 cannot be reached.*Nothing was fitted"):
        list(fitted_on("tcp://127.0.0.1:1", inputs, asked))
    message = r"has no workers\. Nothing was fitted\. Start some: dask worker tcp://127"
    with local_cluster(0) as empty, pytest.raises(GoniometerError, match=message):
        list(fitted_on(empty.scheduler_address, inputs, asked))
