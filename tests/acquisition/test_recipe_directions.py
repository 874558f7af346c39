"""Which directions a recipe measures, and tables of them."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydantic import ValidationError

from acquisition.point_table import point_table
from acquisition.recipe import Recipe

BASE = {
    "recipe": "x",
    "rig": "rig.yaml",
    "wavelength_nm": 550.0,
    "analyzer_deg": [0.0, 45.0, 90.0],
    "readings": 2,
    "exposure_s": 0.03,
    "fit": {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}},
}


def recipe(**changes):
    return Recipe.model_validate({**BASE, **changes})


def test_a_product_has_every_combination_and_the_exit_angle_runs_fastest():
    made = recipe(
        incidence_deg=[60, 30], azimuth_deg={"start_deg": 0, "stop_deg": 45, "step_deg": 45}, exit_deg=[5, -5, 0]
    )
    expected = [(i, e, a, 0) for i in (60, 30) for a in (0, 45) for e in (5, -5, 0)]
    assert_array_equal(made.directions_deg(), expected)
    assert not made.is_one_plane
    assert made.incidences_deg() == (60, 30)


def test_one_incidence_is_what_it_always_was():
    made = recipe(incidence_deg=60, exit_deg=[0, 10])
    assert made.is_one_plane
    assert_array_equal(made.directions_deg(), [(60, 0, 0, 0), (60, 10, 0, 0)])


def test_a_list_of_readings_is_for_the_exit_angles_of_each_plane_or_for_the_points():
    product = recipe(incidence_deg=[30, 60], exit_deg=[0, 10], readings=[1, 7])
    assert product.readings_of_directions() == (1, 7, 1, 7)
    points = [{"incidence_deg": 10, "exit_deg": 1}, {"incidence_deg": 20, "exit_deg": 2}]
    assert recipe(points=points, readings=[3, 4]).readings_of_directions() == (3, 4)
    with pytest.raises(ValidationError, match="one number for each of the 2 points"):
        recipe(points=points, readings=[3, 4, 5])


def test_points_as_a_list_and_as_a_table_are_the_same():
    listed = [{"incidence_deg": 10, "exit_deg": -1.5}, {"incidence_deg": 20, "exit_deg": 2, "azimuth_deg": 90}]
    table = "# two of them\nexit_deg, azimuth_deg, incidence_deg\n-1.5,0,10\n\n2,90,20\n"
    assert_array_equal(recipe(points=listed).directions_deg(), recipe(points=table).directions_deg())
    assert_array_equal(recipe(points=table).directions_deg(), [(10, -1.5, 0, 0), (20, 2, 90, 0)])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"exit_deg": [0]}, "Field required"),
        ({"incidence_deg": 60}, "found neither of the keys exit and exit_deg"),
        ({"points": [{"incidence_deg": 1, "exit_deg": 2}], "azimuth_deg": 3}, "azimuth_deg: stands beside a list"),
        ({"points": []}, "at least 1 item"),
        ({"points_file": "a.csv"}, "a file is found beside a recipe file only"),
        ({"incidence_deg": [], "exit_deg": [0]}, "at least 1 item"),
        ({"incidence_deg": {"start_deg": 0, "stop_deg": 1, "step_deg": 1e-9}, "exit_deg": [0]}, "angles of incidence"),
        (
            {
                "incidence_deg": {"start_deg": 0, "stop_deg": 80, "step_deg": 0.01},
                "exit": {"start_deg": 0, "stop_deg": 80, "step_deg": 0.1},
            },
            "asks for 6408801 directions; allowed: at most 1000000",
        ),
        ({"points": "incidence_deg,exit_deg\n1,x\n"}, "line 2 of the table exit_deg is 'x'"),
    ],
)
def test_what_names_no_directions_is_refused(changes, words):
    with pytest.raises(ValidationError, match=words):
        recipe(**changes)


@pytest.mark.parametrize("steered", [{"until": {"sigma": 0.1}}, {"adaptive": True}])
@pytest.mark.parametrize(
    "directions",
    [
        {"incidence_deg": [30, 60], "exit_deg": [0, 1, 2, 3]},
        {"incidence_deg": 30, "azimuth_deg": [0, 1], "exit_deg": [0, 1, 2, 3]},
        {"points": [{"incidence_deg": 1, "exit_deg": 2}]},
    ],
)
def test_a_scan_that_decides_by_itself_stays_in_one_plane(steered, directions):
    with pytest.raises(ValidationError, match="chooses among exit angles only"):
        recipe(**steered, **directions, time_limit_s=60)


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("", [(1, "holds no table")]),
        ("60,10\n", [(1, "names of the columns are missing")]),
        ("incidence_deg,exit_deg\n", [(1, "no direction follows")]),
        ("incidence_deg,phi_deg\n1,2\n", [(1, "'phi_deg' is not known"), (1, "no column 'exit_deg'")]),
        ("incidence_deg,exit_deg,exit_deg\n1,2,3\n", [(1, "stands 2 times")]),
        ("incidence_deg,exit_deg\n1;2\n", [(2, "1 values for 2 columns")]),
        ("incidence_deg,exit_deg\n# so\n1,nan\n1,inf\n1,1_0\n1,\n", [(3, "nan"), (4, "inf"), (5, "1_0"), (6, "''")]),
        ("incidence_deg,exit_deg\n90,0\n0,86\n-1,0\n", [(2, "0 to 89"), (3, "-85 to 85"), (4, "0 to 89")]),
    ],
)
def test_every_fault_of_a_table_is_named_with_its_line(text, faults):
    found = point_table(text).faults
    assert [line for line, _ in found] == [line for line, _ in faults]
    assert all(part in what for (_, what), (_, part) in zip(found, faults, strict=True))


def test_a_table_of_nonsense_names_twenty_lines_and_no_more():
    found = point_table("incidence_deg,exit_deg\n" + "1,x\n" * 5000).faults
    assert len(found) == 21
    assert "further lines" in found[-1][1]


def test_a_table_keeps_every_digit():
    angles = np.random.default_rng(0).uniform(0, 80, (100, 2))
    text = "incidence_deg,exit_deg\n" + "".join(f"{one!r},{other!r}\n" for one, other in angles.tolist())
    assert_array_equal(point_table(text).angles_deg[:, :2], angles)
