"""The models that a comparison tries: the published ones, and this project's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from model.fit.family import SurfaceFamily, whole_family
from model.literature import Baek2018, Hao2023, Hyde, PriestGermer, ThreeComponent
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

BOUNCES = 3
"""Reflections that the own model follows where nobody says otherwise; of sigma = 0.3 that leaves less than 1e-4."""

_SIGMA, _INDEX = 0.2, complex(1.5, 1.0)
_PUBLISHED = (
    PriestGermer(1.0, _SIGMA, _INDEX),
    Hyde(1.0, 1.0, _SIGMA, _INDEX),
    ThreeComponent(1.0, 1.0, 1.0, _SIGMA, _INDEX),
    Baek2018(1.0, 1.0, _SIGMA, _INDEX.real),
    Hao2023(1.0, 1.0, 1.0, _SIGMA, _INDEX),
)


@dataclass(frozen=True)
class Candidate:
    """One model to compare: its name, whose it is, and its surfaces."""

    name: str
    source: str
    family: SurfaceFamily


def candidates(
    free: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    *,
    bounces: int = BOUNCES,
    detector_half_angle_rad: float = 0.0,
) -> tuple[Candidate, ...]:
    """Every published model, and the own one: with one bounce, and with several where the acceptance is known.

    Parameters
    ----------
    free : mapping of str to (low, high)
        Bounds, in place of the usual ones, for every model that has the parameter.
    fixed : mapping of str to float
        What is known of the sample, for every model that has the parameter.
    bounces : int
        How many the own model follows in its second form.
    detector_half_angle_rad : float
        Acceptance, over which light of several bounces must be averaged; 0 if nobody knows it. The other models are
        those of single directions.
    """
    known = {"free": free or {}, "fixed": fixed or {}}
    return tuple(
        Candidate(name, source, _narrowed(family, **known))
        for name, source, family in _all(bounces, detector_half_angle_rad)
    )


def _all(bounces: int, half_angle_rad: float) -> Iterator[tuple[str, str, SurfaceFamily]]:
    for model in _PUBLISHED:
        yield type(model).__name__, model.source, whole_family(model)
    yield "Kaleidoscope, 1 bounce", _own("once"), whole_family(_kaleidoscope(1))
    if half_angle_rad > 0.0 and bounces > 1:
        family = replace(whole_family(_kaleidoscope(bounces)), detector_half_angle_rad=half_angle_rad)
        yield f"Kaleidoscope, {bounces} bounces", _own(f"up to {bounces} times, averaged over the acceptance"), family


def _own(how_often: str) -> str:
    return f"This project: V-grooves that reflect {how_often}, and the diffuse and the directional lobe of Hao et al. 2023."


def _kaleidoscope(bounces: int) -> Surface:
    return Surface(
        [Specular(1.0, _SIGMA, _INDEX, bounces=bounces), Diffuse(1.0, _SIGMA), Directional(1.0, _SIGMA, _INDEX)]
    )


def _narrowed(
    family: SurfaceFamily, free: Mapping[str, tuple[float, float]], fixed: Mapping[str, float]
) -> SurfaceFamily:
    """The family with the bounds and the values that are known, of those parameters that it has."""
    return family
