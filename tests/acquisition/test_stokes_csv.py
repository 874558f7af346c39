"""The table of Stokes points: exact, self-describing, and refused when damaged."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from acquisition.readings import StokesPoint
from acquisition.stokes_csv import columns, read_stokes_csv, write_stokes_csv
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
def _any_point(draw: st.DrawFn, count: int) -> StokesPoint:
    numbers = iter(draw(st.lists(_NUMBERS, min_size=20, max_size=20)))
    variances = draw(st.lists(st.floats(0.0, 1e300), min_size=count, max_size=count))
    covariance = np.diag(variances) + np.triu(np.full((count, count), next(numbers)), 1)
    return StokesPoint(
        draw(st.integers(0, 10**6)),
        *(next(numbers) for _ in range(3)),
        np.array([next(numbers) for _ in range(count)]),
        covariance,
        *(next(numbers) for _ in range(5 if count == 3 else 9)),
    )


@given(points=st.sampled_from([3, 4]).flatmap(lambda count: st.lists(_any_point(count), max_size=4)))
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
    assert all(column.endswith(units) for column in columns(3) if column not in dimensionless)


def test_s3_has_its_columns_where_it_was_measured_and_nowhere_else(tmp_path: Path) -> None:
    path = tmp_path / "stokes.csv"
    write_stokes_csv(path, [_point(0, -5.0)])
    assert "s3" not in path.read_text(encoding="utf-8")
    assert "docp" not in path.read_text(encoding="utf-8")
    with_s3 = replace(
        _point(0, -5.0),
        stokes=np.array([0.1, 0.01, 0.0, -0.02]),
        covariance=np.eye(4) * 1e-8,
        docp=-0.2,
        docp_stderr=0.01,
        dop=0.22,
        dop_stderr=0.02,
    )
    write_stokes_csv(path, [with_s3])
    table = np.genfromtxt(path, delimiter=",", names=True, skip_header=9)
    assert (table["s3_per_sr"], table["s3_stderr_per_sr"], table["docp"], table["dop"]) == (-0.02, 1e-4, -0.2, 0.22)
    assert "s3 > 0 turns clockwise" in path.read_text(encoding="utf-8")
    _assert_same(read_stokes_csv(path)[0], with_s3)


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
