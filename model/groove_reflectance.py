"""Polarimetric reflectance F_k of grooves in 1/sr, between the macro frames of both rays."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from functools import partial

from model.fresnel import reflection
from model.geometry import Angles, Facet, facet
from model.groove_passage import passages, single_bounce
from model.groove_plane import GroovePlane, groove_plane
from model.groove_polarization import reflect_in_groove
from model.kernel.expression import Value, either, guarded, where
from model.matrix import Matrix, between_frames, mapped, scaled, total


def facet_mueller(at: Facet, n: Value, k: Value) -> Matrix:
    """Mueller matrix of the facet that mirrors i into r, without its density; M of eqs. (6), (7) of Hao et al. 2023."""
    return between_frames(reflection(at.cos, at.sin2, n, k), at.incoming, at.outgoing)


def groove_mueller(at: Angles, bounces: Iterable[int], sigma: Value, asymmetry: Value, n: Value, k: Value) -> Matrix:
    """Sum of F_k over numbers of bounces.

    Parameters
    ----------
    at : Angles
        Where the light comes from and goes to.
    bounces : iterable of int
        Which numbers to sum over.
    sigma, asymmetry : Value
        Of the grooves; the number 0 for symmetric ones.
    n, k : Value
        Refractive index n + ik of the walls.
    """
    wanted, terms = set(bounces), []
    if 1 in wanted:
        wall = facet(at)
        terms.append(scaled(facet_mueller(wall, n, k), single_bounce(wall, sigma, asymmetry)))
    multiple = sorted(wanted - {1})
    if multiple:
        plane = groove_plane(at)
        caustics, chains = zip(*(_chain(plane, count, sigma, asymmetry, n, k) for count in multiple), strict=True)
        matrix = between_frames(total(chains), plane.incoming, plane.outgoing)
        caustic = either(*caustics)
        terms.append(mapped(matrix, lambda element: where(caustic, math.inf, element)))
    return total(terms)


def _chain(
    plane: GroovePlane, bounces: int, sigma: Value, asymmetry: Value, n: Value, k: Value
) -> tuple[Value, Matrix]:
    caustics, ways = [], []
    for passage in passages(bounces, plane, sigma, asymmetry):
        lit = passage.reflectance > 0.0
        matrix = scaled(reflect_in_groove(bounces, plane, passage, n, k).mueller(), passage.reflectance)
        ways.append(mapped(matrix, partial(guarded, lit)))
        caustics.append(passage.caustic)
    first, second, third, fourth = total(ways)
    if bounces % 2:
        # Unfolding mirrors the frame once a bounce: after an odd number S2 and S3 have changed sign.
        third, fourth = mapped((third, fourth, third, fourth), operator.neg)[:2]
    return either(*caustics), (first, second, third, fourth)
