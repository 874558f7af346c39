from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from pydantic import ValidationError

from acquisition.recipe import ExitRange, Recipe

VALID: dict[str, Any] = {
    "recipe": "a measurement",
    "rig": "rig.yaml",
    "wavelength_nm": 550,
    "incidence_deg": 60,
    "exit": {"start_deg": 0, "stop_deg": 60, "step_deg": 1},
    "analyzer_deg": [0, 45, 90, 135],
    "readings": 3,
    "exposure_s": 0.03,
    "fit": {"lobes": ["specular"], "free": {"sigma": [0.02, 1], "n": [1, 6], "k": [0, 8]}},
}


def recipe(**changes: Any) -> Recipe:
    return Recipe.model_validate({**VALID, **changes})


def fit(**changes: Any) -> dict[str, Any]:
    return {**VALID["fit"], **changes}


def test_defaults_are_those_that_the_schema_states() -> None:
    made = recipe()
    assert (made.azimuth_deg, made.dark, made.reference, made.scene) == (0.0, True, None, None)
    assert (made.fit.search, dict(made.fit.fixed)) == ("sobol", {})


@pytest.mark.parametrize(
    ("start", "stop", "step", "count", "last"),
    [
        (0, 60, 1, 61, 60),
        (0, 60, 7, 9, 56),
        (-60, 60, 0.1, 1201, 60),
        (0, 0.3, 0.1, 4, 0.3),
        (0, 1, 0.3, 4, 0.9),
        (10, 10, 5, 1, 10),
        (0, 1, 1 / 3, 4, 1),
        (0, 5, 10, 1, 0),
    ],
)
def test_exit_angles_end_on_the_last_grid_point(
    start: float, stop: float, step: float, count: int, last: float
) -> None:
    angles = recipe(exit={"start_deg": start, "stop_deg": stop, "step_deg": step}).exit_angles_deg()
    assert len(angles) == count
    assert angles[0] == start
    assert_allclose(angles[-1], last, rtol=0, atol=1e-12)


@given(st.floats(-85, 85), st.integers(0, 2000), st.floats(1e-3, 1))
def test_exit_angles_carry_no_accumulated_error(start: float, steps: int, step: float) -> None:
    stop = min(start + steps * step, 85.0)
    angles = np.array(ExitRange(start_deg=start, stop_deg=stop, step_deg=step).angles_deg())
    assert_allclose(angles, start + np.arange(len(angles)) * step, rtol=0, atol=1e-9)
    assert angles[-1] <= stop
    assert stop - angles[-1] < step


def test_a_list_of_exit_angles_is_kept_in_its_order() -> None:
    changed = {key: value for key, value in VALID.items() if key != "exit"}
    assert Recipe.model_validate({**changed, "exit_deg": [30, -5, 0]}).exit_angles_deg() == (30, -5, 0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"incidence_deg": 89.5}, "less than or equal to 89"),
        ({"incidence_deg": -1}, "greater than or equal to 0"),
        ({"incidence_deg": "60"}, "valid number"),
        ({"incidence_deg": True}, "valid number"),
        ({"incidence_deg": float("nan")}, "finite number"),
        ({"wavelength_nm": 0.55}, "greater than or equal to 200"),
        ({"wavelength_nm": 5500}, "less than or equal to 2500"),
        ({"exposure_s": 0}, "greater than 0"),
        ({"exposure_s": 3601}, "less than or equal to 3600"),
        ({"readings": 0}, "greater than or equal to 1"),
        ({"readings": 10001}, "less than or equal to 10000"),
        ({"readings": 3.0}, "valid integer"),
        ({"dark": 1}, "valid boolean"),
        ({"azimuth_deg": 361}, "less than or equal to 360"),
        ({"recipe": ""}, "at least 1 character"),
        ({"laser": "red"}, "Extra inputs"),
        ({"exit": None}, "found neither of the keys exit and exit_deg"),
        ({"exit_deg": [0]}, "found both of the keys exit and exit_deg"),
        ({"exit": None, "exit_deg": []}, "at least 1 item"),
        ({"exit": None, "exit_deg": [0, 86]}, "less than or equal to 85"),
        ({"exit": {"start_deg": 1, "stop_deg": 0, "step_deg": 1}}, "stop_deg: got 0; allowed: start_deg, which is 1"),
        ({"exit": {"start_deg": 0, "stop_deg": 60, "step_deg": 0}}, "greater than 0"),
        ({"exit": {"start_deg": 0, "stop_deg": 60, "step_deg": 5e-324}}, "at most 1000000 angles"),
        ({"reference": {"exit_deg": 45, "every_points": 0}}, "greater than or equal to 1"),
        ({"analyzer_deg": [0, 90]}, "at least 3 items"),
        ({"analyzer_deg": [0, 90, 180]}, "2 different ones"),
        ({"analyzer_deg": [0, 0.1, 0.2]}, "lie so close together"),
        ({"analyzer_deg": [0, 45, 45, 90]}, "the angle 45 stands 2 times"),
        ({"fit": fit(lobes=[])}, "at least 1 item"),
        ({"fit": fit(lobes=["mirror"])}, "'specular', 'diffuse' or 'directional'"),
        ({"fit": fit(lobes=["diffuse", "diffuse"])}, "names 'diffuse' 2 times"),
        ({"fit": fit(free={"sigma": [0.02, 1], "n": [1, 6]})}, "k, the imaginary part .* neither in free nor in fixed"),
        ({"fit": fit(free={"n": [1, 6], "k": [0, 8]})}, "sigma, the rms slope .* neither in free nor in fixed"),
        ({"fit": fit(fixed={"n": 1.5})}, "n stands in free as well"),
        ({"fit": fit(lobes=["diffuse"])}, "the diffuse lobe alone does not depend on k"),
        ({"fit": fit(free={"sigma": [0, 1], "n": [1, 6], "k": [0, 8]})}, "from 1e-05 to 10"),
        ({"fit": fit(free={"sigma": [0.1, 11], "n": [1, 6], "k": [0, 8]})}, "from 1e-05 to 10"),
        ({"fit": fit(free={"sigma": [0.1, 1], "n": [0, 6], "k": [0, 8]})}, "from 0.05 to 20"),
        ({"fit": fit(free={"sigma": [0.1, 1], "n": [2, 2], "k": [0, 8]})}, "the lowest value, then a higher one"),
        (
            {"fit": fit(free={"sigma": [0.1, 1], "n": [2, 3]}, fixed={"k": -1})},
            "fixed.k: got -1; allowed: from 0 to 100",
        ),
        ({"fit": fit(free={"sigma": [0.1], "n": [2, 3], "k": [0, 8]})}, "Field required"),
        ({"fit": fit(search="anneal")}, "'sobol' or 'genetic'"),
    ],
)
def test_what_makes_no_sense_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        recipe(**changes)


def test_a_diffuse_surface_needs_roughness_alone() -> None:
    made = recipe(fit={"lobes": ["diffuse"], "free": {"sigma": [0.02, 1]}})
    assert dict(made.fit.free) == {"sigma": (0.02, 1)}


def test_a_recipe_cannot_be_changed() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        recipe().readings = 4


RETARDED = {"analyzer_deg": [0, 0, 0, 0], "retarder_deg": [-51.7, -15.1, 15.1, 51.7]}


def test_angles_of_polarizer_and_retarder_go_together():
    assert recipe(**RETARDED).settings() == ((0, -51.7), (0, -15.1), (0, 15.1), (0, 51.7))
    assert recipe().settings() == ((0, None), (45, None), (90, None), (135, None))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"retarder_deg": [0, 45]}, r"retarder_deg: got 2 angles; allowed: 4, one for each of analyzer_deg"),
        (RETARDED | {"retarder_deg": [0, 45, 45, 90]}, "the angle 45 goes with the polarizer angle 0 2 times"),
        ({"reference": {"exit_deg": 45, "every_points": 2, "largest_change": 1.5}}, "less than 1"),
    ],
)
def test_settings_that_make_no_sense_are_refused(changes, message):
    with pytest.raises(ValidationError, match=message):
        recipe(**changes)
