"""The models that a comparison tries: the published ones, and this project's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from model.fit.family import SurfaceFamily, whole_family
from model.fit.quantities import INSTRUMENT
from model.literature import Baek2018, Hao2023, Hyde, PriestGermer, ThreeComponent
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

BOUNCES = 3
"""Reflections that the own model follows where nobody says otherwise: more matter to sigma above 0.3 alone."""

# Fits vary these; only that k is not 0 matters, which makes it one of the parameters.
_SIGMA, _INDEX = 0.2, complex(1.5, 1.0)
_PUBLISHED = (
    PriestGermer(1.0, _SIGMA, _INDEX),
    Hyde(1.0, 1.0, _SIGMA, _INDEX),
    ThreeComponent(1.0, 1.0, 1.0, _SIGMA, _INDEX),
    Baek2018(1.0, 1.0, _SIGMA, _INDEX.real),
    Hao2023(1.0, 1.0, 1.0, _SIGMA, _INDEX),
)
_OWN = "This project: V-grooves that reflect {}, and the diffuse and the directional lobe of Hao et al. 2023."


@dataclass(frozen=True)
class Candidate:
    """One model of a comparison.

    Attributes
    ----------
    name : str
        What it is called in tables.
    source : str
        Whose it is, and in which reading.
    family : SurfaceFamily
        Its surfaces.
    refusal : str
        Why it cannot be of the sample, from what is known of that; empty if it can.
    """

    name: str
    source: str
    family: SurfaceFamily
    refusal: str = ""


def candidates(
    known: SurfaceFamily | None = None, *, bounces: int = BOUNCES, detector_half_angle_rad: float = 0.0
) -> tuple[Candidate, ...]:
    """Every published model, and the own one: with one bounce, and with several where the acceptance is known.

    All parameters are free within their usual bounds, but for the asymmetry of grooves, which are symmetric.

    Parameters
    ----------
    known : SurfaceFamily, optional
        What is known of the sample and the instrument: its bounds, values, ties and priors hold for every model that
        has the parameter. Those of one lobe alone, such as ``directional.sigma``, are not handed on.
    bounces : int
        How many the own model follows in its second form.
    detector_half_angle_rad : float
        Acceptance, over which light of several bounces is averaged; 0 if nobody knows it. The other models are those of
        single directions, within which they hardly change.
    """
    every = tuple(_all(bounces, detector_half_angle_rad))
    return every if known is None else tuple(_narrowed(candidate, known) for candidate in every)


def _all(bounces: int, half_angle_rad: float) -> Iterator[Candidate]:
    for model in _PUBLISHED:
        yield Candidate(type(model).__name__, model.source, whole_family(model))
    yield Candidate("V-grooves, 1 bounce", _OWN.format("once"), whole_family(_grooves(1)))
    if half_angle_rad > 0.0 and bounces > 1:
        often = f"up to {bounces} times, averaged over the acceptance"
        family = replace(whole_family(_grooves(bounces)), detector_half_angle_rad=half_angle_rad)
        yield Candidate(f"V-grooves, {bounces} bounces", _OWN.format(often), family)


def _grooves(bounces: int) -> Surface:
    specular = Specular(1.0, _SIGMA, _INDEX, bounces=bounces)
    return Surface([specular, Diffuse(1.0, _SIGMA), Directional(1.0, _SIGMA, _INDEX)])


def _narrowed(candidate: Candidate, known: SurfaceFamily) -> Candidate:
    family = candidate.family
    has = (*family.surface.parameters, *INSTRUMENT)
    fixed = {name: value for name, value in known.fixed.items() if name in has}
    tied = {name: tie for name, tie in known.tied.items() if name in has and tie[0] in has}
    bounds = {**family.free, **{name: pair for name, pair in known.free.items() if name in has}}
    free = {name: pair for name, pair in bounds.items() if name not in fixed and name not in tied}
    prior = {name: belief for name, belief in known.prior.items() if name in free}
    narrow = replace(family, free=free, fixed=fixed, tied=tied, prior=prior)
    return replace(candidate, family=narrow, refusal=_refusal(narrow, known))


def _refusal(family: SurfaceFamily, known: SurfaceFamily) -> str:
    least = known.fixed.get("k", known.free.get("k", (0.0, 0.0))[0])
    if least > 0.0 and "k" not in family.surface.parameters:
        return f"It is of dielectrics, and k of this sample is known to be {least:g} or more."
    return ""
