"""The table of Stokes points: exact, self-describing, and refused when damaged."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from acquisition.readings import StokesPoint
from acquisition.stokes_csv import COLUMNS, read_stokes_csv, write_stokes_csv
from goniometer.errors import JournalError

_NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


def _point(index: int, exit_deg: float) -> StokesPoint:
    return StokesPoint(
        point=index,
        incidence_deg=60.0,
        exit_deg=exit_deg,
        azimuth_deg=0.1,
        stokes=np.array([0.1, 1.0 / 3.0, -2e-17]),
        covariance=np.diag([1e-8, 2e-8, 3e-8]) + 1e-9,
        dolp=0.3,
        dolp_debiased=0.29,
        dolp_stderr=0.01,
        aolp_deg=-45.0,
        aolp_stderr_deg=0.7,
    )


def _assert_same(read: StokesPoint, written: StokesPoint) -> None:
    for field in fields(StokesPoint):
        assert_array_equal(getattr(read, field.name), getattr(written, field.name), err_msg=field.name)


@st.composite
def _any_point(draw: st.DrawFn) -> StokesPoint:
    numbers = iter(draw(st.lists(_NUMBERS, min_size=20, max_size=20)))
    variances = draw(st.lists(st.floats(0.0, 1e300), min_size=3, max_size=3))
    covariance = np.diag(variances) + np.triu(np.full((3, 3), next(numbers)), 1)
    return StokesPoint(
        draw(st.integers(0, 10**6)),
        *(next(numbers) for _ in range(3)),
        np.array([next(numbers) for _ in range(3)]),
        covariance,
        *(next(numbers) for _ in range(5)),
    )


@given(points=st.lists(_any_point(), max_size=4))
def test_every_bit_comes_back(tmp_path_factory: pytest.TempPathFactory, points: list[StokesPoint]) -> None:
    path = tmp_path_factory.mktemp("csv") / "stokes.csv"
    write_stokes_csv(path, points)
    read = read_stokes_csv(path)
    assert len(read) == len(points)
    for one, other in zip(read, points, strict=True):
        _assert_same(one, other)


def test_the_file_explains_itself(tmp_path: Path) -> None:
    write_stokes_csv(tmp_path / "stokes.csv", [_point(0, -5.0)])
    lines = (tmp_path / "stokes.csv").read_text(encoding="utf-8").splitlines()
    comments = " ".join(line for line in lines if line.startswith("#"))
    assert "s1 > 0 is s-polarized" in comments
    assert "exit_deg is signed: positive on the mirror" in comments
    dimensionless = {"point", "dolp", "dolp_debiased", "dolp_stderr"}
    units = ("_deg", "_per_sr", "_per_sr2")
    assert all(column.endswith(units) for column in COLUMNS if column not in dimensionless)


def test_numpy_reads_the_columns_by_name(tmp_path: Path) -> None:
    points = [_point(index, 10.0 * index) for index in range(3)]
    write_stokes_csv(tmp_path / "stokes.csv", points)
    table = np.genfromtxt(tmp_path / "stokes.csv", delimiter=",", names=True, skip_header=7)
    assert_array_equal(table["exit_deg"], [0.0, 10.0, 20.0])
    assert_array_equal(table["s1_stderr_per_sr"], np.sqrt([point.covariance[1, 1] for point in points]))


def test_a_table_written_again_replaces_the_old_one_whole(tmp_path: Path) -> None:
    path = tmp_path / "stokes.csv"
    write_stokes_csv(path, [_point(0, 0.0), _point(1, 1.0)])
    write_stokes_csv(path, [_point(2, 2.0)])
    assert [point.point for point in read_stokes_csv(path)] == [2]
    assert [entry.name for entry in tmp_path.iterdir()] == ["stokes.csv"]


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("exit_deg,", "exit,", "has no column exit_deg"),
        ("60.0", "sixty", "line 9, is damaged: .*sixty"),
        ("60.0,", "", "line 9, is damaged: it has 23 values for 24 columns"),
    ],
)
def test_a_damaged_table_is_refused_with_its_line(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = tmp_path / "stokes.csv"
    write_stokes_csv(path, [_point(0, -5.0)])
    header_first = path.read_text(encoding="utf-8").split("point,", 1)
    path.write_text(header_first[0] + "point," + header_first[1].replace(old, new, 1), encoding="utf-8")
    with pytest.raises(JournalError, match=complaint):
        read_stokes_csv(path)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match=r"nowhere.*cannot be written.*journal"):
        write_stokes_csv(tmp_path / "nowhere" / "stokes.csv", [])
    with pytest.raises(JournalError, match="cannot be read"):
        read_stokes_csv(tmp_path / "nowhere" / "stokes.csv")
