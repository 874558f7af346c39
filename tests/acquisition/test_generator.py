"""The light behind a generator, which settings tell Mueller elements apart, and what a recipe may ask."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.generator import GeneratorState, generator_matrix
from acquisition.recipe import Recipe
from acquisition.settings_matrix import check_settings, condition, settings_shape
from goniometer.errors import ReductionError
from model.mueller import polarizer, retarder

ANGLE = st.floats(-180, 180)
FIT = {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}}
PLATES = (-51.7, -15.1, 15.1, 51.7)


def recipe(**changes):
    return Recipe.model_validate(
        {
            "recipe": "x",
            "rig": "rig.yaml",
            "wavelength_nm": 550.0,
            "incidence_deg": 60.0,
            "exit_deg": [0.0, 1.0, 2.0, 3.0],
            "analyzer_deg": [0.0, 45.0, 90.0, 135.0],
            "readings": 3,
            "exposure_s": 0.03,
            "fit": FIT,
            **changes,
        }
    )


@given(ANGLE, ANGLE, st.floats(1, 359))
def test_a_column_is_what_the_polarizer_passes_behind_the_retarder(polarizer_deg, retarder_deg, retardance_deg):
    both = retarder(math.radians(retardance_deg), math.radians(retarder_deg)) @ polarizer(math.radians(polarizer_deg))
    made = GeneratorState(polarizer_deg, retarder_deg, retardance_deg).column()
    assert_allclose(made, 2.0 * both[:, 0], atol=1e-12)


def test_without_a_generator_light_is_unpolarized_and_the_matrix_has_one_column():
    assert_allclose(GeneratorState().column(), [1, 0, 0, 0])
    assert generator_matrix([GeneratorState()] * 3).shape == (3, 1)
    assert generator_matrix([GeneratorState(0.0), GeneratorState(30.0)]).shape == (2, 3)
    assert generator_matrix([GeneratorState(0.0), GeneratorState(0.0, 45.0, 90.0)]).shape == (2, 4)


def analyzers(*, retards):
    if retards:
        return [AnalyzerState(0.0, angle, 90.0) for angle in PLATES]
    return [AnalyzerState(angle) for angle in (0.0, 45.0, 90.0, 135.0)]


def generators(*, retards):
    if retards:
        return [GeneratorState(0.0, angle, 90.0) for angle in PLATES]
    return [GeneratorState(angle) for angle in (0.0, 60.0, 120.0)]


def product(of_generator, of_analyzer):
    return [(analyzer, generator) for generator in of_generator for analyzer in of_analyzer]


@pytest.mark.parametrize(("behind", "columns"), [(False, 3), (True, 4)])
@pytest.mark.parametrize(("before", "rows"), [(False, 3), (True, 4)])
def test_a_retarder_in_each_arm_adds_a_row_and_a_column(before, rows, behind, columns):
    settings = product(generators(retards=behind), analyzers(retards=before))
    check_settings(settings)
    assert settings_shape(settings) == (rows, columns)


def test_the_condition_numbers_of_both_multiply():
    found = condition(product(generators(retards=True), analyzers(retards=False)))
    plates = np.linalg.cond(np.array([state.column() for state in generators(retards=True)]))
    assert_allclose(found, plates * math.sqrt(2.0), rtol=1e-12)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            product([GeneratorState(0.0), GeneratorState(90.0), GeneratorState(180.0)], analyzers(retards=False)),
            "the generator settings 0, 90, 180 amount to 2 different ones.*the responses to S0, S1 and S2 need",
        ),
        (
            product(generators(retards=False), [AnalyzerState(0.0), AnalyzerState(90.0)]),
            "the analyzer settings 0, 90 amount to 2",
        ),
        (product(generators(retards=False), analyzers(retards=False))[:9], "9 pairs .* do not tell the 9 elements"),
        (
            product([GeneratorState(angle) for angle in (0.0, 1.0, 2.0)], analyzers(retards=False)),
            "the generator settings 0, 1, 2 lie so close together",
        ),
        (
            product(
                [GeneratorState(angle) for angle in (0.0, 20.0, 40.0)], [AnalyzerState(a) for a in (0.0, 20.0, 40.0)]
            ),
            "reach the Mueller matrix enlarged up to .* Spread the angles",
        ),
    ],
)
def test_what_tells_too_little_is_refused(settings, message):
    with pytest.raises(ReductionError, match=message):
        check_settings(settings)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"generator_deg": [0.0, 90.0, 180.0]}, "generator settings 0, 90, 180 amount to 2 different"),
        ({"generator_deg": [0.0, 60.0, 60.0, 120.0]}, "the setting 60 stands 2 times"),
        ({"generator_retarder_deg": [0.0, 60.0, 120.0]}, "needs generator_deg beside it"),
        (
            {"generator_deg": [0.0, 60.0, 120.0], "generator_retarder_deg": [0.0]},
            "got 1 angles; allowed: 3, one for each of generator_deg",
        ),
        (
            {"generator_deg": [0.0, 60.0, 120.0], "fit": FIT | {"objective": "dolp"}},
            "got dolp, which knows of unpolarized light alone",
        ),
    ],
)
def test_a_recipe_that_cannot_be_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        recipe(**changes)
