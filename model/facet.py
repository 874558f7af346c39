"""Reflection off the one facet that mirrors i into r, referred to the macro frames of both rays."""

from __future__ import annotations

import numpy as np

from model.fresnel import reflect
from model.geometry import Directions, FloatArray, Rotation
from model.mueller import rotate, rotator


def facet_mueller(directions: Directions, index: complex) -> FloatArray:
    """Mueller matrices (..., 4, 4) of the facet, without its density; M of eqs. (6) and (7) of Hao et al. 2023."""
    reflection = reflect(directions.cos_facet, directions.sin2_facet, index)
    turn_back = np.swapaxes(rotator(directions.outgoing), -1, -2)
    matrix: FloatArray = turn_back @ reflection.mueller() @ rotator(directions.incoming)
    return matrix


def facet_stokes(directions: Directions, index: complex, incoming: FloatArray) -> FloatArray:
    """Stokes vectors (..., 4) that the facet makes of incoming ones; no Mueller matrix is built.

    Parameters
    ----------
    directions : Directions
        Where the light comes from and goes to.
    index : complex
        Refractive index n + ik of the facet.
    incoming : ndarray
        Stokes vectors (4,) or (..., 4) in the macro frame of the incoming ray.
    """
    reflection = reflect(directions.cos_facet, directions.sin2_facet, index)
    back = Rotation(directions.outgoing.cos2, -directions.outgoing.sin2)
    if not incoming[..., 1:].any():
        s0, s1 = incoming[..., 0] * reflection.mean, incoming[..., 0] * reflection.half_difference
        return np.stack([s0, back.cos2 * s1, -back.sin2 * s1, np.zeros_like(s0)], axis=-1)
    s0, s1, s2, s3 = np.moveaxis(rotate(incoming, directions.incoming), -1, 0)
    reflected = [
        reflection.mean * s0 + reflection.half_difference * s1,
        reflection.half_difference * s0 + reflection.mean * s1,
        reflection.cross_real * s2 - reflection.cross_imag * s3,
        reflection.cross_imag * s2 + reflection.cross_real * s3,
    ]
    return rotate(np.stack(reflected, axis=-1), back)
