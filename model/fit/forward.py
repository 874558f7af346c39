"""Light of many surfaces of a family at once, with its derivatives by the free parameters: one compiled call."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from model.acceptance import Acceptance, Rays
from model.evaluation import Light
from model.fit.family import SurfaceFamily
from model.fit.instrument import ANGLES, moved, reported
from model.fit.lobe_sum import LobeSum
from model.fit.observable import MUELLER
from model.geometry import FloatArray

# Central differences of what a cone sees, by the angles of its axis; exact derivatives would need those of the nodes.
_ANGLE_STEP_RAD = 1e-5


class Forward:
    """Light of surfaces of one family in N directions each.

    Parameters
    ----------
    family : SurfaceFamily
        Which surfaces, seen how.
    elements : int
        How many elements light has: `STOKES` (under unpolarized light) or `MUELLER`.
    incidence_rad, exit_rad, azimuth_rad : ndarray
        Shape (N,) or, if every problem has its own, (problems, N).
    """

    def __init__(
        self,
        family: SurfaceFamily,
        elements: int,
        incidence_rad: FloatArray,
        exit_rad: FloatArray,
        azimuth_rad: FloatArray,
    ) -> None:
        self._family, self._elements = family, elements
        self._directions = tuple(np.atleast_2d(angle) for angle in (incidence_rad, exit_rad, azimuth_rad))
        self.count = self._directions[0].shape[1]
        self._moving = tuple(name for name in family.instrument if name in ANGLES)
        light: Light = "mueller" if elements == MUELLER else "unpolarized"
        cones = family.detector_half_angle_rad > 0.0
        if cones:
            self._acceptance = self._resolving({name: low for name, (low, _) in family.free.items()})
            groups = [[family.lobes[i] for i in part.places] for part in self._acceptance.parts]
        else:
            groups = [list(family.lobes)]
        one_incidence = not cones and bool((np.ptp(self._directions[0], axis=1) == 0.0).all())
        varied = tuple(name for name in family.names if name not in family.instrument)
        angles = () if cones else self._moving
        self._sums = [LobeSum(family, lobes, light, varied, angles, one_incidence) for lobes in groups]
        self._has_cones = cones
        self._rays: list[Rays] | None = None

    def __call__(self, x: FloatArray, problems: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
        """Light (b, E, N) and derivatives (b, P, E, N) for the parameters x (b, P) of these problems."""
        values = dict(zip(self._family.names, x.T, strict=True))
        directions = [angle if len(angle) == 1 else angle[problems] for angle in self._directions]
        seen = self._cones if self._has_cones else self._rays_of
        light, slopes = seen(values, directions, len(x))
        return reported(self._family, values, light, slopes)

    def resolving(self, x: FloatArray) -> Forward:
        """The same with cones' nodes just dense enough for surfaces like these, x (b, P), instead of for all."""
        if not self._has_cones:
            return self
        like = copy.copy(self)
        like._acceptance = self._resolving(dict(zip(self._family.names, x.min(axis=0).tolist(), strict=True)))
        like._rays = None
        return like

    def _resolving(self, narrowest: Mapping[str, float]) -> Acceptance:
        return Acceptance(self._family.surface_of(narrowest), self._family.detector_half_angle_rad)

    def _rays_of(
        self, values: Mapping[str, FloatArray], directions: Sequence[FloatArray], count: int
    ) -> tuple[FloatArray, ...]:
        at, turns = moved(self._family, values, directions, count)
        only = self._sums[0]
        light, slopes = only(values, at, count, self._elements)
        names = [*only.varied, *self._moving]
        for name, turn in turns.items():
            slopes[:, names.index(name)] *= turn[:, None, :]
        return light, self._in_order(slopes, names)

    def _cones(
        self, values: Mapping[str, FloatArray], directions: Sequence[FloatArray], count: int
    ) -> tuple[FloatArray, ...]:
        if not self._moving:
            if self._rays is None:
                self._rays = self._nodes([angle[0] for angle in self._directions])
            light, slopes = self._mean(values, self._rays, count)
            return light, self._in_order(slopes, [*self._sums[0].varied])
        lights, shapes = [], []
        for i in range(count):
            one = {name: value[i : i + 1] for name, value in values.items()}
            own = [angle[min(i, len(angle) - 1)][None] for angle in directions]
            light, slopes = self._mean_at(one, own)
            for name in self._moving:
                ahead, behind = (
                    self._mean_at({**one, name: one[name] + step}, own)[0]
                    for step in (_ANGLE_STEP_RAD, -_ANGLE_STEP_RAD)
                )
                slopes = np.concatenate([slopes, ((ahead - behind) / (2.0 * _ANGLE_STEP_RAD))[:, None]], axis=1)
            lights.append(light)
            shapes.append(slopes)
        names = [*self._sums[0].varied, *self._moving]
        return np.concatenate(lights), self._in_order(np.concatenate(shapes), names)

    def _mean_at(self, values: Mapping[str, FloatArray], directions: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        at, _ = moved(self._family, values, directions, 1)
        return self._mean(values, self._nodes([angle[0] for angle in at]), 1)

    def _nodes(self, directions: Sequence[FloatArray]) -> list[Rays]:
        return [self._acceptance.rays(part, directions) for part in self._acceptance.parts]

    def _mean(self, values: Mapping[str, FloatArray], rays: Sequence[Rays], count: int) -> tuple[FloatArray, ...]:
        light: FloatArray | float = 0.0
        slopes: FloatArray | float = 0.0
        for some, at in zip(self._sums, rays, strict=True):
            nodes = [angle.reshape(1, -1) for angle in at.angles]
            bright, steep = some(values, nodes, count, self._elements)
            light = light + _averaged(bright, at)
            slopes = slopes + _averaged(steep, at)
        return np.asarray(light), np.asarray(slopes)

    def _in_order(self, slopes: FloatArray, names: Sequence[str]) -> FloatArray:
        """Derivatives by all free parameters in their order, 0 for those that come in later."""
        wanted = self._family.names
        if tuple(names) == wanted:
            return slopes
        ordered = np.zeros((slopes.shape[0], len(wanted), *slopes.shape[2:]))
        places = [wanted.index(name) for name in names]
        ordered[:, places] = slopes
        return ordered


def _averaged(elements: FloatArray, rays: Rays) -> FloatArray:
    """Means over cones of elements (..., E, cones · nodes), seen behind an analyzer that does not turn with the ray."""
    split = elements.reshape(*elements.shape[:-1], *rays.weight.shape)
    columns = split.shape[-3] // 4
    rows = [slice(row * columns, (row + 1) * columns) for row in range(4)]
    weight = rays.weight
    cosine, sine = weight * rays.to_analyzer.cos2, weight * rays.to_analyzer.sin2

    def mean(row: int, weights: FloatArray) -> FloatArray:
        total: FloatArray = np.einsum("...cn,cn->...c", split[..., rows[row], :, :], weights)
        return total

    turned = (
        mean(0, weight),
        mean(1, cosine) + mean(2, sine),
        mean(2, cosine) - mean(1, sine),
        mean(3, weight),
    )
    return np.concatenate(turned, axis=-2)
