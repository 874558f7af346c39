"""Light of many surfaces of a family at once, with its derivatives by the free parameters: one compiled call."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from model.acceptance import Acceptance, Rays
from model.evaluation import DIRECTIONS, Light, Program
from model.fit.family import SurfaceFamily
from model.fit.instrument import ANGLES, moved, reported
from model.fit.observable import MUELLER
from model.fit.wiring import Wiring, named
from model.geometry import FloatArray
from model.kernel.kernel import Kernel
from model.lobes import Lobe
from model.surface import rate_input

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


class LobeSum:
    """Light of some lobes of a family, and its derivatives: the program of it, and what that takes.

    Parameters
    ----------
    family : SurfaceFamily
        What is free.
    lobes : sequence of Lobe
        Some of the family's.
    light : Light
        What to make of the sum.
    varied : tuple of str
        Free parameters of the surface to derive by.
    angles : tuple of str
        Offsets of angles to derive by, after those.
    one_incidence : bool
        Whether all directions of a problem have the same incidence.
    """

    def __init__(
        self,
        family: SurfaceFamily,
        lobes: Sequence[Lobe],
        light: Light,
        varied: tuple[str, ...],
        angles: tuple[str, ...],
        one_incidence: bool,
    ) -> None:
        self.varied = varied
        self._wiring = Wiring(
            family, [i for i, known in enumerate(family.lobes) if any(known is lobe for lobe in lobes)]
        )
        example = {name: 0.5 * (low + min(high, low + 1.0)) for name, (low, high) in family.free.items()}
        numbers, rates = self._wiring.inputs({name: np.array([value]) for name, value in example.items()})
        changes = tuple(
            tuple((source, rate_input(source, name, rate)) for (source, by), rate in rates.items() if by == name)
            for name in varied
        )
        changes += tuple(((ANGLES[name], 1.0),) for name in angles)
        inputs = (*numbers, *named(rates))
        addends = tuple(self._wiring.addends(family.surface_of(example)))
        self.program = Program(addends, inputs, light, changes, with_light=True)
        self._one_incidence = one_incidence

    @property
    def uniform(self) -> frozenset[str]:
        """Inputs that are one number for all directions of a problem."""
        return frozenset(self.program.inputs) | frozenset(["incidence"] if self._one_incidence else [])

    def inputs(self, values: Mapping[str, FloatArray], at: Sequence[FloatArray]) -> list[NDArray[np.float64]]:
        """What the program takes for these values (b,) of the free parameters and directions (b or 1, N), in order."""
        numbers, rates = self._wiring.inputs(values)
        given = {**numbers, **named(rates)}
        incidence = at[0][:, :1] if self._one_incidence else at[0]
        return [
            incidence,
            *at[1:],
            *(np.asarray(given[name], np.float64).reshape(-1, 1) for name in self.program.inputs),
        ]

    def __call__(
        self, values: Mapping[str, FloatArray], at: Sequence[FloatArray], times: int, elements: int
    ) -> tuple[FloatArray, FloatArray]:
        """Light (times, elements, N) and derivatives (times, names, elements, N)."""
        rows = self._kernel.repeated(self.inputs(values, at), times, at[1].shape[1])
        split = np.asarray(rows, np.float64).reshape(times, -1, elements, rows.shape[-1])
        return split[:, 0], split[:, 1:]

    @cached_property
    def _kernel(self) -> Kernel:
        return _compiled(self.program, self.uniform)


@cache
def _compiled(program: Program, uniform: frozenset[str]) -> Kernel:
    return Kernel(program.record, [*DIRECTIONS, *program.inputs], uniform, "float64")


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
