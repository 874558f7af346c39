"""Mueller matrices over half and difference angles, in the frames that Mitsuba's ``measured_polarized`` reads them in.

Rusinkiewicz' coordinates: the half vector h stands between the directions to source and detector, theta_h from the
normal; theta_d is the angle from h to either; phi_d turns the source about h, and at 0 the source is the lower one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from model.acceptance import Acceptance
from model.geometry import FloatArray, Rotation
from model.mueller import rotator
from model.surface import Surface

LOWEST_RAD = np.radians(89.0)
"""Rays closer to the horizon are given the reflectance of this angle: beyond it some lobes grow without bounds, and a
table would carry that into directions well above the horizon."""


Reflectance = Surface | Acceptance


def half_angles(
    incidence_rad: FloatArray, exit_rad: FloatArray, azimuth_rad: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """phi_d (-pi to pi), theta_d and theta_h of pairs of directions."""
    source, detector = _unit(incidence_rad, 0.0 * azimuth_rad), _unit(exit_rad, azimuth_rad)
    half = source + detector
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    theta_h = np.arctan2(np.hypot(half[..., 0], half[..., 1]), half[..., 2])
    theta_d = np.arctan2(np.linalg.norm(np.cross(half, source), axis=-1), _dot(half, source))
    across = np.stack([-half[..., 1], half[..., 0], 0.0 * theta_h], axis=-1)  # z × h
    down = np.cross(across, half)
    phi_d = np.arctan2(_dot(across, source), _dot(down, source))
    return phi_d, theta_d, theta_h


def rays(phi_d_rad: FloatArray, theta_d_rad: FloatArray, theta_h_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (..., 3) to source and detector, with the half vector at azimuth 0."""
    half, leaning = _half_and_leaning(phi_d_rad, theta_h_rad)
    along, aside = np.cos(theta_d_rad)[..., None] * half, np.sin(theta_d_rad)[..., None] * leaning
    return along + aside, along - aside


def mueller_in_facet_frames(
    surface: Reflectance, phi_d_rad: ArrayLike, theta_d_rad: ArrayLike, theta_h_rad: ArrayLike
) -> FloatArray:
    """Mueller matrices whose Stokes vectors refer to the plane of the two rays: +S1 is perpendicular to it.

    Parameters
    ----------
    surface : Reflectance
        What reflects; its matrices refer to the macro s-directions.
    phi_d_rad, theta_d_rad, theta_h_rad : array_like
        Broadcast. Directions below the horizon, which a table has where it must be interpolated up to the horizon, are
        lifted to `LOWEST_RAD`.

    Returns
    -------
    ndarray
        Shape (..., 4, 4), in 1/sr, from the frame of the incoming to that of the outgoing ray.
    """
    phi_d, theta_d, theta_h = np.broadcast_arrays(phi_d_rad, theta_d_rad, theta_h_rad)
    half, leaning = _half_and_leaning(phi_d, theta_h)
    source, detector = rays(phi_d, theta_d, theta_h)
    incidence, source_azimuth = _lifted(source)
    exit_, detector_azimuth = _lifted(detector)
    matrices = surface.mueller(incidence, exit_, detector_azimuth - source_azimuth)
    across = np.cross(leaning, half)  # perpendicular to both rays, also where they coincide
    from_facet = _to_facet(-_unit(incidence, source_azimuth), source_azimuth + np.pi, across)
    to_facet = _to_facet(_unit(exit_, detector_azimuth), detector_azimuth, across)
    turned: FloatArray = to_facet @ matrices @ np.swapaxes(from_facet, -1, -2)
    return turned


def _to_facet(ray: FloatArray, azimuth_rad: FloatArray, across: FloatArray) -> FloatArray:
    """Rotator from a ray's macro s-direction, z × ray, to the direction across the plane of both rays."""
    x = np.stack([-np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0 * azimuth_rad], axis=-1)
    turn = 2.0 * np.arctan2(_dot(np.cross(ray, x), across), _dot(x, across))
    return rotator(Rotation(np.cos(turn), np.sin(turn)))


def _half_and_leaning(phi_d_rad: FloatArray, theta_h_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The half vector, and perpendicular to it the direction to which the source leans from it."""
    half = _unit(theta_h_rad, 0.0 * phi_d_rad)
    down = _unit(theta_h_rad + np.pi / 2.0, 0.0 * phi_d_rad)
    sideways = np.zeros_like(half)
    sideways[..., 1] = 1.0
    return half, np.cos(phi_d_rad)[..., None] * down + np.sin(phi_d_rad)[..., None] * sideways


def _lifted(direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Polar angle, at most `LOWEST_RAD`, and azimuth."""
    polar = np.arctan2(np.hypot(direction[..., 0], direction[..., 1]), direction[..., 2])
    return np.minimum(polar, LOWEST_RAD), np.arctan2(direction[..., 1], direction[..., 0])


def _unit(polar_rad: FloatArray, azimuth_rad: FloatArray) -> FloatArray:
    sine = np.sin(polar_rad)
    return np.stack([sine * np.cos(azimuth_rad), sine * np.sin(azimuth_rad), np.cos(polar_rad)], axis=-1)


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    product: FloatArray = (one * other).sum(axis=-1)
    return product
