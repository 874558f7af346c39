"""What an instrument sees: reflectance averaged over the cones of directions that detector and source accept.

A detector has a half-angle of acceptance, and behind it an analyzer that does not turn with the ray: outgoing Stokes
vectors refer to the s-direction of the central ray, projected perpendicular to each ray, and those of a source's cone
likewise. Both means are (1/Ω) ∫ F dω; directions below the horizon count as dark.

Straight grooves send light of two and more bounces towards the mirror direction as C(ψ)/ρ, a caustic that the mean
over a cone makes finite: the quadrature runs along lines through that direction. Means are in double precision.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from model.cone_quadrature import Cones, cones
from model.domain import require_directions
from model.geometry import FloatArray, Rotation
from model.lobes import Lobe
from model.lobes.lobe import Peak
from model.mueller import UNPOLARIZED, rotate, rotator
from model.stokes import require_stokes
from model.surface import Surface, require_parameters

WIDEST_RAD = np.radians(30.0)
_NARROWEST_RAD = 1e-9
# Lines need not be denser than this, so close to the horizon.
_LEAST_COSINE = 1e-3
# Directions that are averaged at a time, so that the nodes of many cones need not be in memory at once.
_AT_ONCE = 2**18


@dataclass(frozen=True)
class Part:
    """The lobes that stand about one direction, by their places in the surface, and the width of the narrowest."""

    surface: Surface
    places: tuple[int, ...]
    peak: Peak
    width_rad: float


def half_angle_rad(solid_angle_sr: float) -> float:
    """Half-angle of the circular cone with a solid angle of up to 2 pi sr."""
    return float(2.0 * np.arcsin(np.sqrt(solid_angle_sr / (4.0 * np.pi))))


@dataclass(frozen=True)
class Rays:
    """Pairs of directions out of the cones of central pairs, and how their frames stand to those of the central rays.

    Attributes
    ----------
    angles : tuple of ndarray
        Incidence, exit and azimuth, shape (pairs, nodes).
    weight : ndarray
        Same shape.
    from_source, to_analyzer : Rotation
        From a ray's own s-direction to that of the central ray, for the incoming and the outgoing ray.
    """

    angles: tuple[FloatArray, FloatArray, FloatArray]
    weight: FloatArray
    from_source: Rotation[FloatArray]
    to_analyzer: Rotation[FloatArray]

    def arriving(self, stokes: FloatArray) -> FloatArray:
        """Stokes vectors of the source, (4,) or (pairs, 1, 4), in the incoming rays' own frames."""
        if not stokes[..., 1:].any():
            return stokes
        return rotate(stokes, Rotation(self.from_source.cos2, -self.from_source.sin2))


class Acceptance:
    """A surface as an instrument with finite acceptance sees it; the same calls as on the surface itself.

    Parameters
    ----------
    surface : Surface
        What is looked at.
    detector_half_angle_rad : float
        Half-angle of the cone about the exit direction, 1e-9 rad to 30°; 0 for a single direction.
    source_half_angle_rad : float
        Half-angle of the cone about the direction of incidence; 0 for a collimated source.
    nodes : int
        Nodes on each of the quadrature's lines, of which there are four times as many; so many again for every halving
        of the cone that a narrow lobe calls for. With a source's cone the cost goes with the fourth power, otherwise
        with the square. Where a cone crosses the horizon or a clamp of the model, means converge slowly (to some 1e-2).

    Raises
    ------
    ValueError
        If a half-angle or the number of nodes is outside its range.
    """

    def __init__(
        self, surface: Surface, detector_half_angle_rad: float, source_half_angle_rad: float = 0.0, nodes: int = 6
    ) -> None:
        for name, angle in (
            ("detector_half_angle_rad", detector_half_angle_rad),
            ("source_half_angle_rad", source_half_angle_rad),
        ):
            if angle != 0.0 and not _NARROWEST_RAD <= angle <= WIDEST_RAD:
                raise ValueError(f"{name} is {angle:g}; allowed is 0, or {_NARROWEST_RAD:g} rad to 30°.")
        if nodes < 1:
            raise ValueError(f"nodes is {nodes}; at least one is needed.")
        self.surface = surface
        self.detector_half_angle_rad = detector_half_angle_rad
        self.source_half_angle_rad = source_half_angle_rad
        self.nodes = nodes
        # Lobes narrower than the cone are resolved where they stand.
        peaks: tuple[Peak, ...] = ("mirror", "normal")
        self.parts = [
            _part(surface, places, peak)
            for peak in peaks
            if (places := tuple(place for place, lobe in enumerate(surface.lobes) if lobe.peak == peak))
        ]

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """What the surface is made of."""
        return self.surface.lobes

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that `jacobian` takes."""
        return self.surface.parameters

    def mueller(self, incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> FloatArray:
        """Mean Mueller matrices (..., 4, 4) in 1/sr; arguments as for `Surface.mueller`, of the central rays."""

        def matrices(surface: Surface, at: Rays) -> FloatArray:
            lamp = np.swapaxes(rotator(at.from_source), -1, -2)
            return rotator(at.to_analyzer) @ surface.mueller(*at.angles) @ lamp

        return self._mean(matrices, incidence_rad, exit_rad, azimuth_rad)

    def stokes(
        self,
        incidence_rad: ArrayLike,
        exit_rad: ArrayLike,
        azimuth_rad: ArrayLike,
        incoming: ArrayLike = UNPOLARIZED,
    ) -> FloatArray:
        """Mean Stokes vectors (..., 4) in 1/sr; arguments as for `Surface.stokes`, of the central rays."""
        state = require_stokes(incoming)

        def vectors(surface: Surface, at: Rays, arriving: FloatArray) -> FloatArray:
            return rotate(surface.stokes(*at.angles, at.arriving(arriving)), at.to_analyzer)

        return self._mean(vectors, incidence_rad, exit_rad, azimuth_rad, state)

    def jacobian(
        self,
        parameters: Sequence[str],
        incidence_rad: ArrayLike,
        exit_rad: ArrayLike,
        azimuth_rad: ArrayLike,
        incoming: ArrayLike = UNPOLARIZED,
    ) -> FloatArray:
        """Derivatives (..., 4, parameters) of `stokes` by parameters; arguments as for `Surface.jacobian`."""
        state = require_stokes(incoming)

        names = require_parameters(parameters, self.parameters)

        def slopes(surface: Surface, at: Rays, arriving: FloatArray) -> FloatArray:
            jacobian = np.zeros((len(names), *at.weight.shape, 4))
            known = [place for place, name in enumerate(names) if name in surface.parameters]
            if known:
                slopes = surface.jacobian([names[i] for i in known], *at.angles, at.arriving(arriving))
                jacobian[known] = np.moveaxis(slopes, -1, 0)
            return np.moveaxis(rotate(jacobian, at.to_analyzer), 0, -1)

        return self._mean(slopes, incidence_rad, exit_rad, azimuth_rad, state)

    def describe(self) -> str:
        """What the surface consists of and what the instrument averages over."""
        source = np.degrees(self.source_half_angle_rad)
        lamp = f"and of {source:.3g}° about the incidence" if source else "and a collimated source"
        return (
            f"{self.surface.describe()}\nSeen through an acceptance cone of half-angle "
            f"{np.degrees(self.detector_half_angle_rad):.3g}° about the exit {lamp}, by {self.nodes} nodes a line; the "
            f"analyzer keeps the axis of the central ray."
        )

    def _mean(
        self,
        evaluate: Callable[..., FloatArray],
        incidence_rad: ArrayLike,
        exit_rad: ArrayLike,
        azimuth_rad: ArrayLike,
        incoming: FloatArray | None = None,
    ) -> FloatArray:
        require_directions(incidence_rad, exit_rad, azimuth_rad)
        # The single-precision number next to pi/2 is above it.
        given = [np.minimum(np.asarray(angle, np.float64), np.pi / 2.0) for angle in (incidence_rad, exit_rad)]
        given.append(np.asarray(azimuth_rad, np.float64))
        states_shape = () if incoming is None else incoming.shape[:-1]
        shape = np.broadcast_shapes(*(angle.shape for angle in given), states_shape)
        flat = [np.broadcast_to(angle, shape).reshape(-1) for angle in given]
        states = incoming
        if incoming is not None and states_shape:
            states = np.broadcast_to(incoming, (*shape, 4)).reshape(-1, 1, 4)
        total = sum(self._mean_of_part(part, evaluate, flat, states, not states_shape) for part in self.parts)
        mean = np.asarray(total)
        return mean.reshape(*shape, *mean.shape[1:])

    def _mean_of_part(
        self,
        part: Part,
        evaluate: Callable[..., FloatArray],
        directions: Sequence[FloatArray],
        states: FloatArray | None,
        one_state: bool,
    ) -> FloatArray:
        panels = self._panels(part, directions)
        cone = 4 * self.nodes**2 * panels
        step = max(1, _AT_ONCE // (cone * cone if self.source_half_angle_rad else cone))
        means = []
        for start in range(0, max(len(directions[0]), 1), step):
            some = slice(start, start + step)
            at = self._rays(part, panels, *(angle[some] for angle in directions))
            extra = [] if states is None else [states if one_state else states[some]]
            means.append(np.einsum("pn,pn...->p...", at.weight, evaluate(part.surface, at, *extra)))
        return np.concatenate(means)

    def rays(self, part: Part, directions: Sequence[FloatArray]) -> Rays:
        """The rays by which the mean of a part is taken, for central directions (pairs,)."""
        return self._rays(part, self._panels(part, directions), *directions)

    def _panels(self, part: Part, directions: Sequence[FloatArray]) -> int:
        # Across the plane of incidence a lobe about the mirror direction is narrower by the cosine.
        widest = max(self.detector_half_angle_rad, self.source_half_angle_rad)
        polar = max((float(angle.max(initial=0.0)) for angle in directions[:2]), default=0.0)
        across = max(math.cos(polar), _LEAST_COSINE) if part.peak == "mirror" else 1.0
        halvings = math.log2(widest / (part.width_rad * across)) if widest and math.isfinite(part.width_rad) else 0.0
        return 1 + max(0, math.ceil(halvings))

    def _rays(self, part: Part, panels: int, incidence: FloatArray, exit_: FloatArray, azimuth: FloatArray) -> Rays:
        count = len(incidence)
        lamp_polar, lamp_turn = incidence[:, None], np.zeros((count, 1))
        weight = np.ones((count, 1))
        if self.source_half_angle_rad:
            # Seen from the source the caustic is where the exit direction is mirrored to.
            source = self.source_half_angle_rad
            pole = exit_, azimuth + np.pi
            lamp = cones(incidence, np.zeros(count), source, *pole, _stretch(exit_, panels), self.nodes, panels)
            lamp_polar, lamp_turn, weight = lamp.polar_rad, lamp.azimuth_rad, lamp.weight
        sources = lamp_polar.shape[1]
        exits, azimuths = np.repeat(exit_, sources), np.repeat(azimuth, sources)
        pole = lamp_polar.ravel(), lamp_turn.ravel() + np.pi
        if part.peak == "normal":
            pole = np.zeros(len(exits)), azimuths
        seen = Cones(exits[:, None], azimuths[:, None], np.ones((len(exits), 1)))
        if self.detector_half_angle_rad:
            half_angle = self.detector_half_angle_rad
            seen = cones(exits, azimuths, half_angle, *pole, _stretch(pole[0], panels), self.nodes, panels)
        nodes = seen.polar_rad.shape[1]
        shape = (count, sources * nodes)
        exit_node, azimuth_node = seen.polar_rad.reshape(shape), seen.azimuth_rad.reshape(shape)
        lamp_polar, lamp_turn = np.repeat(lamp_polar, nodes, axis=1), np.repeat(lamp_turn, nodes, axis=1)
        return Rays(
            angles=(lamp_polar, exit_node, azimuth_node - lamp_turn),
            weight=(seen.weight.reshape(count, sources, nodes) * weight[..., None]).reshape(shape),
            from_source=_frame_turn(np.cos(lamp_turn), np.cos(lamp_polar) * np.sin(lamp_turn)),
            to_analyzer=_frame_turn(
                np.cos(azimuth_node - azimuth[:, None]), -np.cos(exit_node) * np.sin(azimuth_node - azimuth[:, None])
            ),
        )


def _part(surface: Surface, places: tuple[int, ...], peak: Peak) -> Part:
    lobes = [surface.lobes[place] for place in places]
    return Part(Surface(lobes), places, peak, min(lobe.width_rad for lobe in lobes))


def _frame_turn(x: FloatArray, y: FloatArray) -> Rotation[FloatArray]:
    # (x, y): the central ray's s-direction in the ray's own frame, not yet of unit length.
    length2 = x**2 + y**2
    return Rotation(cos2=(x - y) * (x + y) / length2, sin2=2.0 * x * y / length2)


def _stretch(polar_rad: FloatArray, panels: int) -> FloatArray:
    # Lobes and caustic about the mirror direction are narrower across the plane by the cosine, the cone is not: where
    # the lobe is the narrower one lines go by it, otherwise half way.
    cosine = np.maximum(np.cos(polar_rad), _LEAST_COSINE)
    return cosine if panels > 1 else np.sqrt(cosine)
