"""Where a table has its angles: close together where linear interpolation would err, found by bisection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from goniometer.pbsdf.half_angles import Reflectance, half_angles, mueller_in_facet_frames, rays
from model.geometry import FloatArray

DARK_PER_SR = 1e-3 / np.pi
"""Where a surface is darker than a thousandth of a white diffuser, errors count against that instead."""
STEEPEST_RAD = np.radians(85.0)
"""Directions by which a table is made and judged end here."""

_PAIRS = 20_000
_COARSE = (10, 10, 10)
"""Intervals of phi_d, theta_d and theta_h to begin with."""
_WORTH = 0.5
"""Intervals that are bisected together: those whose share of the error is at least this part of the largest."""


@dataclass(frozen=True)
class Axes:
    """The angles of a table, in rad: phi_d from -pi to pi, theta_d and theta_h from 0 to pi/2."""

    phi_d_rad: FloatArray
    theta_d_rad: FloatArray
    theta_h_rad: FloatArray

    @property
    def shape(self) -> tuple[int, int, int]:
        """How many angles there are of each."""
        return self.phi_d_rad.size, self.theta_d_rad.size, self.theta_h_rad.size


def random_pairs(count: int, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """phi_d, theta_d and theta_h in rad of pairs of directions down to `STEEPEST_RAD`, many where lobes may be narrow.

    Half of them have incidence, exit and azimuth evenly distributed, and so are many near the normal; the other half
    crowd about the mirror direction.
    """
    draw = np.random.default_rng(seed)
    incidence, exit_ = draw.uniform(0.0, STEEPEST_RAD, (2, count))
    even = np.stack(half_angles(incidence, exit_, draw.uniform(0.0, 2.0 * np.pi, count)))
    phi_d, theta_d, crowd = draw.uniform(0.0, 1.0, (3, 2 * count))
    crowded = np.stack([(2.0 * phi_d - 1.0) * np.pi, theta_d * STEEPEST_RAD, crowd**3 * STEEPEST_RAD])
    polar = [np.arccos(np.clip(ray[..., 2], -1.0, 1.0)) for ray in rays(*crowded)]
    crowded = crowded[:, np.maximum(*polar) < STEEPEST_RAD]
    half = count // 2
    phi_d, theta_d, theta_h = np.concatenate([even[:, : count - half], crowded[:, :half]], axis=1)
    return phi_d, theta_d, theta_h


def relative_error(found: FloatArray, true: FloatArray) -> FloatArray:
    """Largest deviation of any element of Mueller matrices (..., 4, 4), against F00 or at least `DARK_PER_SR`."""
    worst: FloatArray = np.abs(found - true).max(axis=(-2, -1)) / np.maximum(true[..., 0, 0], DARK_PER_SR)
    return worst


def fitting_axes(surface: Reflectance, nodes: int, seed: int = 0) -> Axes:
    """Angles for a table of at most so many directions, by which linear interpolation of a surface errs least.

    Beginning with a coarse grid, the intervals are bisected that cause most of the mean error for what a further
    angle costs, which is a whole layer of the table.

    Parameters
    ----------
    surface : Reflectance
        What is tabulated.
    nodes : int
        The most directions, 1331 and up.
    seed : int
        Of the directions by which errors are judged.

    Raises
    ------
    ValueError
        If the surface is infinite somewhere.
    """
    # The light of an isotropic surface is the same at +phi_d and -phi_d but for signs: half of the axis decides.
    starts = (np.pi, np.pi / 2.0, np.pi / 2.0)
    axes = [np.linspace(0.0, end, count + 1) for end, count in zip(starts, _COARSE, strict=True)]
    phi_d, theta_d, theta_h = random_pairs(_PAIRS, seed)
    angles = [np.abs(phi_d), theta_d, theta_h]
    true = mueller_in_facet_frames(surface, *angles)
    errors = [_error_of_intervals(surface, axes, axis, angles, true) for axis in range(3)]
    while True:
        costs = [_nodes(axes) / (axis.size - 1) for axis in axes]
        shares = [error / cost for error, cost in zip(errors, costs, strict=True)]
        least = _WORTH * max(share.max() for share in shares)
        finer = [_bisected(axis, share >= least) for axis, share in zip(axes, shares, strict=True)]
        if _nodes(finer) > nodes:
            return Axes(np.concatenate([-axes[0][:0:-1], axes[0]]), axes[1], axes[2])
        for place in range(3):
            if finer[place].size > axes[place].size:
                errors[place] = _error_of_intervals(surface, finer, place, angles, true)
        axes = finer


def _error_of_intervals(
    surface: Reflectance, axes: list[FloatArray], axis: int, angles: list[FloatArray], true: FloatArray
) -> FloatArray:
    """Sum of the relative errors that interpolation along one axis alone makes in each of its intervals."""
    nodes, here = axes[axis], angles[axis]
    interval = np.clip(np.searchsorted(nodes, here, side="right") - 1, 0, nodes.size - 2)
    low, high = nodes[interval], nodes[interval + 1]
    share = ((here - low) / (high - low))[:, None, None]
    at_low, at_high = (mueller_in_facet_frames(surface, *_replaced(angles, axis, end)) for end in (low, high))
    errors = relative_error((1.0 - share) * at_low + share * at_high, true)
    if not np.isfinite(errors).all():
        raise ValueError("The surface has directions of infinite reflectance, which no table can hold.")
    return np.asarray(np.bincount(interval, errors, nodes.size - 1), np.float64)


def _replaced(angles: list[FloatArray], axis: int, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    phi_d, theta_d, theta_h = (angle if place == axis else kept for place, kept in enumerate(angles))
    return phi_d, theta_d, theta_h


def _bisected(nodes: FloatArray, chosen: FloatArray) -> FloatArray:
    middles = (nodes[:-1] + nodes[1:])[chosen] / 2.0
    return np.sort(np.concatenate([nodes, middles]))


def _nodes(axes: list[FloatArray]) -> int:
    phi_d, theta_d, theta_h = (axis.size for axis in axes)
    return (2 * phi_d - 1) * theta_d * theta_h
