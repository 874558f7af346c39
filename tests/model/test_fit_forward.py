"""Light of many surfaces at once, as an instrument that errs reports it, and its derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.fit import SurfaceFamily, lobe_family
from model.fit.forward import Forward
from model.fit.observable import MUELLER, STOKES
from model.geometry import Rotation
from model.literature import Baek2018, Hao2023, Hyde, PriestGermer, ThreeComponent
from model.lobes import Diffuse, Directional, Specular
from model.mueller import rotator
from model.surface import Surface

LOBES = ("specular", "diffuse", "directional")
SHAPES = {"sigma": (0.05, 1.0), "n": (0.2, 6.0), "k": (0.0, 8.0), "asymmetry": (0.0, 0.8)}
VALUES = {"sigma": 0.31, "n": 1.7, "k": 2.3, "asymmetry": 0.35, "rho_s": 0.6, "rho_d": 0.2, "rho_dd": 0.07}
OFFSETS = {
    "incidence_offset_rad": 0.011,
    "exit_offset_rad": -0.017,
    "analyzer_offset_rad": 0.05,
    "gain": 1.13,
    "background_per_sr": 0.021,
}
WIDE = {"incidence_offset_rad": (-0.1, 0.1), "exit_offset_rad": (-0.1, 0.1), "analyzer_offset_rad": (-0.3, 0.3)}
WIDE |= {"gain": (0.5, 2.0), "background_per_sr": (-1.0, 1.0)}
RANDOM = np.random.default_rng(11)
AT = RANDOM.uniform(0.2, 1.3, 13), RANDOM.uniform(0.1, 1.3, 13), RANDOM.uniform(0.0, 2.0 * np.pi, 13)
ONE = np.zeros(1, np.int64)


def light(family: SurfaceFamily, values: dict[str, float], elements: int = STOKES, at=AT) -> tuple:
    x = np.array([[values[name] for name in family.names]])
    found, slopes = Forward(family, elements, *at)(x, ONE)
    return found[0], slopes[0]


def assert_slopes_are_differences(family: SurfaceFamily, values: dict[str, float], elements: int, rtol: float) -> None:
    _, slopes = light(family, values, elements)
    for place, name in enumerate(family.names):
        step = 1e-6 * max(abs(values[name]), 0.1)
        ahead, behind = (light(family, values | {name: values[name] + s}, elements)[0] for s in (step, -step))
        difference = (ahead - behind) / (2.0 * step)
        assert_allclose(slopes[place], difference, rtol=rtol, atol=1e-7 * np.abs(difference).max() + 1e-9)


@pytest.mark.parametrize("elements", [STOKES, MUELLER])
def test_light_is_that_of_the_surface(elements: int) -> None:
    family = lobe_family(LOBES, SHAPES)
    found, slopes = light(family, VALUES, elements)
    surface = family.seen(VALUES)
    expected = surface.stokes(*AT) if elements == STOKES else surface.mueller(*AT).reshape(-1, 16)
    assert_allclose(found.T, expected, rtol=1e-12, atol=1e-15)
    if elements == STOKES:
        assert_allclose(
            np.moveaxis(slopes, 0, -1).swapaxes(0, 1), surface.jacobian(family.names, *AT), rtol=1e-12, atol=1e-13
        )


@pytest.mark.parametrize("elements", [STOKES, MUELLER])
def test_a_cone_sees_what_the_acceptance_says(elements: int) -> None:
    family = lobe_family(LOBES, SHAPES, bounces=3, detector_half_angle_rad=0.01)
    found, slopes = light(family, VALUES, elements)
    seen = family.seen(VALUES)
    expected = seen.stokes(*AT) if elements == STOKES else seen.mueller(*AT).reshape(-1, 16)
    assert_allclose(found.T, expected, rtol=1e-11, atol=1e-14)
    if elements == STOKES:
        assert_allclose(
            np.moveaxis(slopes, 0, -1).swapaxes(0, 1), seen.jacobian(family.names, *AT), rtol=1e-11, atol=1e-12
        )


@pytest.mark.parametrize(
    "surface",
    [
        PriestGermer(0.7, 0.3, 1.5 + 0.2j),
        Hyde(0.7, 0.1, 0.3, 1.5 + 0.2j),
        ThreeComponent(0.7, 0.1, 0.05, 0.3, 1.5 + 0.2j),
        Baek2018(0.7, 0.1, 0.3, 1.5),
        Hao2023(0.7, 0.1, 0.05, 0.3, 1.5 + 0.2j, bounces=2),
        Surface([Specular(0.2, 0.4, 1.5), Diffuse(0.1, 0.4, averages="exact")]),
    ],
)
def test_any_surface_serves_as_a_template(surface: Surface) -> None:
    values = {name: value for lobe in surface.lobes for name, value in lobe.values.items()}
    free = {name: (0.5 * value, 2.0 * value) for name, value in values.items() if value}
    family = SurfaceFamily(surface, free)
    found, slopes = light(family, values)
    assert_allclose(found.T, surface.stokes(*AT), rtol=1e-12, atol=1e-15)
    again = family.surface_of(values)
    assert type(again) is type(surface)
    assert_allclose(found.T, again.stokes(*AT), rtol=1e-12, atol=1e-15)
    assert_allclose(
        np.moveaxis(slopes, 0, -1).swapaxes(0, 1), again.jacobian(family.names, *AT), rtol=1e-11, atol=1e-12
    )


def test_many_surfaces_at_once_are_those_one_by_one() -> None:
    family = lobe_family(LOBES, {**SHAPES, **WIDE})
    many = np.array([list({**VALUES, **OFFSETS}.values())] * 5) * RANDOM.uniform(0.8, 1.2, (5, 12))
    names = list({**VALUES, **OFFSETS})
    x = many[:, [names.index(name) for name in family.names]]
    own = [RANDOM.uniform(0.2, 1.2, (7, 13)) for _ in range(3)]
    which = np.array([6, 0, 3, 3, 1])
    together = Forward(family, STOKES, *own)(x, which)
    for place, number in enumerate(which):
        alone = Forward(family, STOKES, *(angle[number] for angle in own))(x[place : place + 1], ONE)
        for both, one in zip(together, alone, strict=True):
            assert_allclose(both[place], one[0], rtol=1e-13, atol=1e-16)


def test_the_instrument_reports_what_it_says() -> None:
    family = lobe_family(LOBES, {**SHAPES, **WIDE})
    found, _ = light(family, {**VALUES, **OFFSETS})
    inc, out, phi = AT
    # An arm's exit angle is counted towards the mirror side, which is the half of azimuths around pi.
    towards = np.where(np.cos(phi) < 0.0, 1.0, -1.0)
    true = inc + OFFSETS["incidence_offset_rad"], out + towards * OFFSETS["exit_offset_rad"], phi
    stokes = lobe_family(LOBES, SHAPES).seen(VALUES).stokes(*true)
    stokes[:, 0] += OFFSETS["background_per_sr"]

    def power(at: float, state: np.ndarray) -> np.ndarray:
        return 0.5 * (state[:, 0] + state[:, 1] * np.cos(2.0 * at) + state[:, 2] * np.sin(2.0 * at))

    for angle in (0.0, 0.7, 2.0):
        behind_turned = OFFSETS["gain"] * power(angle + OFFSETS["analyzer_offset_rad"], stokes)
        assert_allclose(power(angle, found.T), behind_turned, rtol=1e-12)


def test_an_arm_that_passes_the_normal_looks_from_the_other_side() -> None:
    family = lobe_family(LOBES, {**SHAPES, "exit_offset_rad": (-0.1, 0.1)})
    at = np.array([1.0]), np.array([0.01]), np.array([np.pi])
    found, slopes = light(family, {**VALUES, "exit_offset_rad": -0.03}, at=at)
    other_side = lobe_family(LOBES, SHAPES).seen(VALUES).stokes(1.0, 0.02, 0.0)
    assert_allclose(found[:, 0], other_side, rtol=1e-12, atol=1e-15)
    ahead, behind = (light(family, {**VALUES, "exit_offset_rad": -0.03 + s}, at=at)[0] for s in (1e-6, -1e-6))
    assert_allclose(slopes[-1], (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("elements", [STOKES, MUELLER])
def test_slopes_by_everything_are_differences(elements: int) -> None:
    family = lobe_family(LOBES, {**SHAPES, **WIDE})
    assert_slopes_are_differences(family, {**VALUES, **OFFSETS}, elements, 1e-6)


def test_slopes_of_a_cone_with_offsets_are_differences() -> None:
    family = lobe_family(LOBES, {**SHAPES, **WIDE}, bounces=2, detector_half_angle_rad=0.02)
    assert_slopes_are_differences(family, {**VALUES, **OFFSETS}, STOKES, 2e-5)


def test_ties_and_parameters_of_one_lobe() -> None:
    family = lobe_family(
        LOBES,
        {"sigma": (0.1, 1.0), "directional.sigma": (0.1, 1.0), "n": (1.0, 3.0)},
        tied={"k": ("n", 1.4), "diffuse.sigma": ("directional.sigma", 0.5), "rho_dd": ("rho_d", 0.25)},
    )
    assert family.names == ("sigma", "directional.sigma", "n", "rho_s", "rho_d")
    values = {"sigma": 0.2, "directional.sigma": 0.5, "n": 1.8, "rho_s": 0.7, "rho_d": 0.2}
    expected = Surface([Specular(0.7, 0.2, 1.8 + 2.52j), Diffuse(0.2, 0.25), Directional(0.05, 0.5, 1.8 + 2.52j)])
    assert_allclose(light(family, values)[0].T, expected.stokes(*AT), rtol=1e-12, atol=1e-15)
    assert_slopes_are_differences(family, values, STOKES, 1e-6)
    held = family.holding("rho_d", 0.4)
    assert held.fixed["rho_dd"] == 0.1
    assert held.names == ("sigma", "directional.sigma", "n", "rho_s")


def test_a_mueller_matrix_turns_its_rows_with_the_analyzer() -> None:
    family = lobe_family(LOBES, {**SHAPES, "analyzer_offset_rad": (-0.7, 0.7)})
    plain = lobe_family(LOBES, SHAPES).seen(VALUES).mueller(*AT)
    found, _ = light(family, {**VALUES, "analyzer_offset_rad": 0.3}, MUELLER)
    turned = rotator(Rotation(np.cos(0.6), np.sin(0.6))) @ plain
    assert_allclose(found.T.reshape(-1, 4, 4), turned, rtol=1e-12, atol=1e-15)
