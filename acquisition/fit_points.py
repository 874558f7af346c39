"""From measured directions and a recipe's fit section to a fit, and back: the one place where degrees become radians.

What a person writes and reads in degrees has a name that ends in ``_deg``; in the model the same ends in ``_rad``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike

from acquisition.fit_choice import FitChoice
from acquisition.readings import MuellerPoint, StokesPoint
from goniometer.errors import FitError
from model.acceptance import half_angle_rad
from model.fit import Dataset, FitResult, SurfaceFamily, lobe_family
from model.fit.dataset import Objective
from model.fit.observable import MUELLER, Elements
from model.fit.start import Search
from model.geometry import FloatArray, in_plane

_DEG, _RAD = "_deg", "_rad"
_MODEL_NAME = re.compile(r"\b(\w+)_rad\b")


class FitArguments(TypedDict):
    """How `model.fit.fit` is called: what of a recipe's fit section is not about surfaces."""

    objective: Objective
    search: Search
    robust: bool


def dataset(points: Sequence[StokesPoint], name: str = "the data") -> Dataset:
    """Stack the Stokes parameters of a scan's points, all of them S0 to S2 or all S0 to S3, into arrays.

    Where Mueller matrices were measured, all their elements. Messages call them by a name.
    """
    there = directions(
        [point.incidence_deg for point in points],
        [point.exit_deg for point in points],
        exit_azimuth_deg=[point.exit_azimuth_deg or 0.0 for point in points],
    )
    measured = [point for point in points if isinstance(point, MuellerPoint)]
    if measured:
        rows, columns = measured[0].mueller.shape
        picked = tuple(4 * row + column for row in range(rows) for column in range(columns))
        values = np.array([point.mueller.ravel() for point in measured])
        covariance = np.array([point.mueller_covariance for point in measured])
        return Dataset(*there, values, covariance, Elements(picked, MUELLER), name=name)
    stokes = np.array([point.stokes for point in points])
    return Dataset(
        *there,
        values=stokes,
        covariance=np.array([point.covariance for point in points]),
        observable=Elements(tuple(range(stokes.shape[-1]))),
        name=name,
    )


def directions(
    incidence_deg: ArrayLike,
    exit_deg: ArrayLike,
    phi_deg: ArrayLike | None = None,
    *,
    exit_azimuth_deg: ArrayLike = 0.0,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Incidence, exit and azimuth in rad; without an azimuth, a signed exit angle becomes an exit angle and an azimuth.

    The plane in which that exit angle lies may be turned by an exit azimuth about the surface normal, right-handed. An
    incidence that was read back a little below zero is one from the other side, seen mirrored.
    """
    incidence_rad, exit_rad = np.radians(np.asarray(incidence_deg)), np.radians(np.asarray(exit_deg))
    if phi_deg is not None:
        return incidence_rad, exit_rad, np.radians(np.asarray(phi_deg))
    exit_rad, phi_rad = in_plane(np.where(incidence_rad < 0.0, -exit_rad, exit_rad))
    return np.abs(incidence_rad), exit_rad, phi_rad + np.radians(np.asarray(exit_azimuth_deg))


def in_radians(name: str, values: ArrayLike) -> FloatArray:
    """Values as the model counts them: in rad if their name says that they are in degrees."""
    return np.radians(np.asarray(values)) if name.endswith(_DEG) else np.asarray(values)


def surface_family(choice: FitChoice, acceptance_sr: float | None) -> SurfaceFamily:
    """The surfaces that a fit section allows, seen with a detector of this acceptance where that matters.

    After one bounce reflectance hardly changes within a detector's cone. After two it has a pole in the mirror
    direction, and only its average over the cone means anything.

    Raises
    ------
    FitError
        If the acceptance matters and is not known.
    """
    half_angle = 0.0
    if choice.bounces > 1:
        if acceptance_sr is None:
            raise FitError(
                f"The fit follows {choice.bounces} bounces, whose light depends on the detector's acceptance, which is "
                "not known here. Nothing was fitted. Give a whole recipe, whose rig states acceptance_sr, or fit one "
                "bounce."
            )
        half_angle = half_angle_rad(acceptance_sr)
    return lobe_family(
        choice.lobes,
        free={model_name(name): _pair_in_radians(name, bounds) for name, bounds in choice.free.items()},
        fixed={model_name(name): float(in_radians(name, value)) for name, value in choice.fixed.items()},
        tied={name: (other, factor) for name, (other, factor) in choice.tied.items()},
        prior={model_name(name): _pair_in_radians(name, known) for name, known in choice.prior.items()},
        bounces=choice.bounces,
        detector_half_angle_rad=half_angle,
    )


def fit_arguments(choice: FitChoice) -> FitArguments:
    """How a fit section wants `model.fit.fit` to be called."""
    return FitArguments(objective=choice.objective, search=choice.search, robust=choice.robust)


def in_degrees(result: FitResult) -> FitResult:
    """A fit as people read it: parameters that are angles in degrees, and under a name that says so."""

    def shown(name: str) -> str:
        return name.removesuffix(_RAD) + _DEG if name.endswith(_RAD) else name

    def unit(name: str) -> float:
        return math.radians(1.0) if name.endswith(_RAD) else 1.0

    def converted(values: Mapping[str, float]) -> dict[str, float]:
        return {shown(name): value / unit(name) for name, value in values.items()}

    return replace(
        result,
        parameters={
            shown(name): replace(
                estimate,
                value=estimate.value / unit(name),
                stderr=None if estimate.stderr is None else estimate.stderr / unit(name),
            )
            for name, estimate in result.parameters.items()
        },
        names=tuple(map(shown, result.names)),
        held=converted(result.held),
        weakness=result.weakness and replace(result.weakness, changes=converted(result.weakness.changes)),
        alternatives=tuple(replace(other, parameters=converted(other.parameters)) for other in result.alternatives),
    )


@contextmanager
def named_in_degrees() -> Iterator[None]:
    """Within it, refusals call the instrument's angles what people call them, ``exit_offset_deg``."""
    try:
        yield
    except FitError as error:
        raise FitError(_MODEL_NAME.sub(rf"\1{_DEG}", str(error))) from error


def model_name(name: str) -> str:
    """What the model calls a parameter that people name."""
    return name.removesuffix(_DEG) + _RAD if name.endswith(_DEG) else name


def _pair_in_radians(name: str, pair: tuple[float, float]) -> tuple[float, float]:
    first, second = in_radians(name, pair).tolist()
    return first, second
