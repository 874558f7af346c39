"""Effects are parts: a surface that does not name one computes the same bytes as if there were no such effect."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from model import evaluation
from model.lobes import Diffuse, Directional, Lobe, Specular
from model.surface import Surface

IRON = 2.95 + 2.932j
RANDOM = np.random.default_rng(5)
AT = RANDOM.uniform(0.0, 1.5, 300), RANDOM.uniform(0.0, 1.5, 300), RANDOM.uniform(-3.1, 3.1, 300)

Light = Callable[[], NDArray]


def specular(**options: object) -> Lobe:
    return Specular(0.7, 0.4, IRON, **options)  # type: ignore[arg-type]


def mueller(*lobes: Lobe) -> NDArray:
    return Surface(lobes).mueller(*AT)


# Effect: functions that are its own, a surface without it, and with it.
EFFECTS: dict[str, tuple[list[str], Light, Light]] = {
    "diffuse lobe": (
        ["model.lobes.diffuse._lambertian_facets"],
        lambda: mueller(specular(bounces=2), Directional(0.1, 0.4, IRON)),
        lambda: mueller(specular(bounces=2), Directional(0.1, 0.4, IRON), Diffuse(0.3, 0.4)),
    ),
    "directional lobe": (
        ["model.lobes.directional._towards_the_normal"],
        lambda: mueller(specular(), Diffuse(0.3, 0.4)),
        lambda: mueller(specular(), Diffuse(0.3, 0.4), Directional(0.1, 0.4, IRON)),
    ),
    "Fresnel reflection": (
        ["model.fresnel.amplitudes", "model.groove_polarization.amplitudes", "model.groove_reflectance.reflection"],
        lambda: mueller(Diffuse(0.3, 0.4)),
        lambda: mueller(Diffuse(0.3, 0.4), specular(bounces=2)),
    ),
    "second bounce": (
        ["model.groove_reflectance.groove_plane", "model.groove_reflectance.passages", "model.groove_slope.solve"],
        lambda: mueller(specular(asymmetry=0.2)),
        lambda: mueller(specular(asymmetry=0.2, bounces=2)),
    ),
    "asymmetry": (
        ["model.groove_slope._kepler", "model.groove_visibility._odd", "model.groove_visibility._even"],
        lambda: mueller(specular(bounces=3)),
        lambda: mueller(specular(bounces=3, asymmetry=0.2)),
    ),
    "single-fresnel reading": (
        ["model.lobes.specular.single_fresnel_mueller"],
        lambda: mueller(specular(bounces=2)),
        lambda: mueller(specular(bounces=2, reading="single-fresnel")),
    ),
    "kaleidoscope reading": (
        ["model.lobes.specular.groove_mueller", "model.groove_reflectance.single_bounce"],
        lambda: mueller(specular(bounces=2, reading="single-fresnel")),
        lambda: mueller(specular(bounces=2)),
    ),
    "derivatives": (
        ["model.evaluation.derivatives"],
        lambda: Surface([specular(bounces=2)]).stokes(*AT),
        lambda: Surface([specular(bounces=2)]).jacobian(["sigma"], *AT),
    ),
    "polarized light": (
        ["model.evaluation.applied"],
        lambda: Surface([specular(bounces=2)]).stokes(*AT),
        lambda: Surface([specular(bounces=2)]).stokes(*AT, [1.0, 0.5, 0.0, 0.0]),
    ),
}


@pytest.fixture
def nothing_recorded() -> Iterator[None]:
    """Formulas are recorded anew in the test, and after it."""
    evaluation._kernel.cache_clear()
    yield
    evaluation._kernel.cache_clear()


@pytest.mark.usefixtures("nothing_recorded")
@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_not_asked_for_is_not_there(effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    functions, without, with_it = EFFECTS[effect]
    before = without()
    calls: list[str] = []

    def absent(name: str) -> Callable[..., object]:
        def function(*_: object) -> object:
            calls.append(name)
            raise NotImplementedError(name)

        return function

    for name in functions:
        monkeypatch.setattr(name, absent(name))
    evaluation._kernel.cache_clear()
    assert_array_equal(without(), before)
    assert calls == []
    with pytest.raises(NotImplementedError):
        with_it()


@pytest.mark.parametrize(
    "lobe",
    [Diffuse(0.3, 0.4), Directional(0.1, 0.4, IRON), specular(asymmetry=0.3, bounces=3), Diffuse(0.2, 0.1, "exact")],
    ids=repr,
)
def test_a_further_lobe_changes_no_byte_of_the_others(lobe: Lobe) -> None:
    others = [specular(bounces=2), specular(bounces=2, reading="single-fresnel")]
    assert_array_equal(mueller(*others, lobe), mueller(*others) + mueller(lobe))


@pytest.mark.parametrize("lobe", [Diffuse(0.0, 0.4), Directional(0.0, 0.4, IRON)], ids=repr)
def test_a_lobe_of_no_weight_changes_no_byte(lobe: Lobe) -> None:
    assert_array_equal(mueller(specular(bounces=2), lobe), mueller(specular(bounces=2)))


def test_numbers_do_not_make_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    # A fit evaluates thousands of surfaces: only what decides which operations there are may compile one.
    mueller(specular(asymmetry=0.2), Diffuse(0.3, 0.4))
    monkeypatch.setattr("model.evaluation.Kernel", None)
    for sigma, index in ((0.1, 1.5 + 0j), (0.7, IRON)):
        mueller(Specular(0.2, sigma, index, 0.5), Diffuse(0.1, sigma, "exact"))
