"""Polarimetric reflectance F_k of grooves, once the plane across them is known; the same plane serves every k."""

from __future__ import annotations

import numpy as np

from model.geometry import FloatArray, Rotation
from model.groove_passage import passages
from model.groove_plane import GroovePlane
from model.groove_polarization import reflect_in_groove
from model.mueller import rotate, rotator


def groove_mueller(plane: GroovePlane, bounces: int, sigma: float, asymmetry: float, index: complex) -> FloatArray:
    """Mueller matrices (..., 4, 4) in 1/sr of exactly so many bounces; arguments as for `vgroove.bounce_mueller`."""
    chain, caustic = np.zeros((4, 4, *plane.rho.shape)), np.zeros(plane.rho.shape, np.bool_)
    for passage in passages(bounces, plane, sigma, asymmetry):
        jones = reflect_in_groove(bounces, plane, passage, index)
        chain[..., passage.lit] += passage.reflectance[passage.lit] * jones.mueller()
        caustic |= passage.caustic
    turn_back = np.swapaxes(rotator(plane.outgoing), -1, -2)
    matrix = turn_back @ np.moveaxis(_folded(chain, bounces), (0, 1), (-2, -1)) @ rotator(plane.incoming)
    return np.where(caustic[..., None, None], np.inf, matrix)


def groove_stokes(
    plane: GroovePlane, bounces: int, sigma: float, asymmetry: float, index: complex, incoming: FloatArray
) -> FloatArray:
    """Stokes vectors (..., 4) in 1/sr that `groove_mueller` makes of incoming ones; unpolarized light needs no matrix.

    The plane must have the shape that it and the incoming states broadcast to.
    """
    unpolarized = not incoming[..., 1:].any()
    arriving = np.moveaxis(rotate(incoming, plane.incoming), -1, 0)
    chain, caustic = np.zeros(arriving.shape), np.zeros(plane.rho.shape, np.bool_)
    for passage in passages(bounces, plane, sigma, asymmetry):
        jones = reflect_in_groove(bounces, plane, passage, index)
        lit = passage.reflectance[passage.lit] * arriving[:, passage.lit]
        if unpolarized:
            chain[:, passage.lit] += lit[0] * jones.first_column()
        else:
            chain[:, passage.lit] += np.einsum("ijm,jm->im", jones.mueller(), lit)
        caustic |= passage.caustic
    back = Rotation(plane.outgoing.cos2, -plane.outgoing.sin2)
    stokes = rotate(np.moveaxis(_folded(chain, bounces), 0, -1), back)
    return np.where(caustic[..., None], np.inf, stokes)


def _folded(unfolded: FloatArray, bounces: int) -> FloatArray:
    # Unfolding mirrors the frame once a bounce: after an odd number S2 and S3 (axis 0) have changed sign.
    sign = 1.0 - 2.0 * (bounces % 2)
    return np.concatenate([unfolded[:2], sign * unfolded[2:]])
