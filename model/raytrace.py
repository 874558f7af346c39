"""Rays in explicit V-grooves by Monte Carlo: an independent check of the closed form of `vgroove`.

A groove is a prism along its axis: two plane walls rise from a bottom edge to one height, where an open lid closes it.
Rays enter through the lid z = 0, are followed in three dimensions from wall to wall, and leave through the lid. Nothing
is shared with the closed form.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.geometry import FloatArray
from model.slopes import require_sigma

Rays = NDArray[np.intp]


@dataclass(frozen=True)
class Sample:
    """A mean over rays and its standard error, arrays of one shape."""

    mean: FloatArray
    stderr: FloatArray


@dataclass(frozen=True)
class LitSurface:
    """A surface of V-grooves under light from one direction.

    Attributes
    ----------
    incidence_rad : float
        Angle of incidence, 0 to below pi/2.
    sigma : float
        rms slope per axis.
    asymmetry : float
        The walls of a groove have 1 ± asymmetry times its mean slope; 0 to below 1.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    incidence_rad: float
    sigma: float
    asymmetry: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.incidence_rad < np.pi / 2.0:
            raise ValueError(f"incidence_rad is {self.incidence_rad:g}; allowed is 0 to below pi/2.")
        if not 0.0 <= self.asymmetry < 1.0:
            raise ValueError(f"asymmetry is {self.asymmetry:g}; allowed is 0 to below 1.")
        require_sigma(self.sigma)

    @property
    def travel(self) -> FloatArray:
        """Unit vector along which the light comes down."""
        return np.array([-np.sin(self.incidence_rad), 0.0, -np.cos(self.incidence_rad)])


@dataclass(frozen=True)
class Grooves:
    """One groove of unit width for every ray.

    Attributes
    ----------
    normals : ndarray
        Upward normals of the wall that faces s and of the one that faces -s, shape (2, rays, 3).
    bottom, entry : ndarray
        A point of the bottom edge, and the point of the lid where the ray comes in, shape (rays, 3).
    """

    normals: FloatArray
    bottom: FloatArray
    entry: FloatArray

    def select(self, rays: Rays) -> Grooves:
        """The grooves of some of the rays."""
        return Grooves(self.normals[:, rays], self.bottom[rays], self.entry[rays])


def draw_grooves(slope: FloatArray, azimuth_rad: FloatArray, asymmetry: float, random: np.random.Generator) -> Grooves:
    """Grooves of given mean slope and direction s, each as likely as its mirror image and lit evenly over its lid.

    Parameters
    ----------
    slope, azimuth_rad : ndarray
        Mean slope t of both walls, and azimuth of s, shape (rays,).
    asymmetry : float
        The walls have the slopes t (1 ± asymmetry).
    random : Generator
        Decides which wall is the steeper, and where the ray comes in.
    """
    steeper = np.where(random.random(slope.size) < 0.5, 1.0, -1.0)
    slopes = slope * np.stack([1.0 + asymmetry * steeper, 1.0 - asymmetry * steeper])
    depth = slopes.prod(axis=0) / slopes.sum(axis=0)
    s = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad), np.zeros_like(slope)], axis=-1)
    up = np.array([0.0, 0.0, 1.0])
    facing = np.stack([s, -s]) * slopes[..., None] + up
    # The wall that faces s is the one on the side of -s; s is counted from the bottom edge.
    position = random.random(slope.size) - depth / slopes[0]
    normals = facing / np.linalg.norm(facing, axis=-1, keepdims=True)
    return Grooves(normals, -depth[:, None] * up, position[:, None] * s)


def reflections(grooves: Grooves, travel: FloatArray) -> Iterator[tuple[Rays, FloatArray, FloatArray, FloatArray]]:
    """Follow rays through their grooves, bounce by bounce, until all have left.

    Parameters
    ----------
    grooves : Grooves
        One for every ray.
    travel : ndarray
        Direction (3,) in which all rays come down.

    Yields
    ------
    rays, normals, before, after
        The numbers of the rays that meet a wall for the first, second, ... time, the normals there, and the directions
        of travel before and after.
    """
    rays = np.arange(len(grooves.entry))
    point, direction = grooves.entry, np.broadcast_to(travel, grooves.entry.shape)
    while rays.size:
        approach = -np.einsum("wri,ri->wr", grooves.normals, direction)
        height = np.einsum("wri,ri->wr", grooves.normals, point - grooves.bottom)
        to_walls = np.divide(height, approach, out=np.full_like(height, np.inf), where=approach > 0.0)
        rises = direction[:, 2] > 0.0
        to_lid = np.divide(-point[:, 2], direction[:, 2], out=np.full_like(point[:, 2], np.inf), where=rises)
        wall = np.argmin(to_walls, axis=0)
        distance = to_walls[wall, np.arange(rays.size)]
        inside = np.flatnonzero(distance < to_lid)
        rays, grooves, wall = rays[inside], grooves.select(inside), wall[inside]
        before, normals = direction[inside], grooves.normals[wall, np.arange(rays.size)]
        point = point[inside] + distance[inside, None] * before
        direction = before - 2.0 * np.einsum("ri,ri->r", before, normals)[:, None] * normals
        if rays.size:
            yield rays, normals, before, direction


def bounce_fractions(lit: LitSurface, *, rays: int, seed: int) -> Sample:
    """Fractions of the light on a perfect mirror surface that leave after 1, 2, ... bounces.

    Parameters
    ----------
    lit : LitSurface
        The surface and its illumination.
    rays : int
        How many are traced.
    seed : int
        Of the random numbers; the same seed gives the same result.

    Returns
    -------
    Sample
        Shape (most bounces that a ray has made,).
    """
    random = np.random.default_rng(seed)
    slope = lit.sigma * np.sqrt(-2.0 * np.log1p(-random.random(rays)))
    grooves = draw_grooves(slope, 2.0 * np.pi * random.random(rays), lit.asymmetry, random)
    bouncing = np.array([met.size for met, *_ in reflections(grooves, lit.travel)])
    fractions = -np.diff(bouncing, append=0) / rays
    return Sample(fractions, np.sqrt(fractions * (1.0 - fractions) / rays))
