"""What an instrument that errs makes of light: arms off their zero, a turned analyzer, gain, stray light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from model.fit.family import SurfaceFamily
from model.geometry import FloatArray

ANGLES = {"incidence_offset_rad": "incidence", "exit_offset_rad": "exit"}
"""Parameters that turn a ray, and the angle that they change."""


def moved(
    family: SurfaceFamily, values: Mapping[str, FloatArray], directions: Sequence[FloatArray], count: int
) -> tuple[list[FloatArray], dict[str, FloatArray]]:
    """Where the rays truly are, and for each free offset how fast the angle that it changes rises with it.

    Angles (b or 1, N) stay angles from the normal: a ray that crosses it goes on, on the other side.
    """
    incidence, exit_, azimuth = directions
    if not any(name in values or name in family.fixed for name in ANGLES):
        return [incidence, exit_, azimuth], {}
    turns = {}
    for name in ANGLES:
        offset = np.asarray(values.get(name, family.held(name)))
        if name not in values and not offset.any():
            continue
        by = np.broadcast_to(offset.reshape(-1, 1), (count, 1))
        if name == "exit_offset_rad":
            towards = np.where(np.cos(azimuth) < 0.0, 1.0, -1.0)
            exit_, azimuth, turn = _beyond_normal(exit_ + towards * by, azimuth)
            turn = turn * towards
        else:
            incidence, azimuth, turn = _beyond_normal(incidence + by, azimuth)
        if name in values:
            turns[name] = np.broadcast_to(turn, (count, azimuth.shape[1]))
    shape = (count, azimuth.shape[1])
    return [np.broadcast_to(angle, shape) for angle in (incidence, exit_, azimuth)], turns


def _beyond_normal(polar: FloatArray, azimuth: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    crossed = polar < 0.0
    return np.abs(polar), np.where(crossed, azimuth - np.pi, azimuth), np.where(crossed, -1.0, 1.0)


def reported(
    family: SurfaceFamily, values: Mapping[str, FloatArray], light: FloatArray, slopes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Light (b, E, N) and derivatives (b, P, E, N) as the instrument reports them: gain · turned (light + background).

    An analyzer that stands at an azimuth of more than it is taken for turns the light's azimuth back by the difference.
    """
    present = {
        name for name in (*values, *family.fixed) if name in ("analyzer_offset_rad", "gain", "background_per_sr")
    }
    if not present:
        return light, slopes
    count, names = len(light), family.names
    columns = light.shape[1] // 4

    def value(name: str) -> FloatArray:
        return np.broadcast_to(np.asarray(values.get(name, family.held(name)), np.float64), (count,))

    light, slopes = light.copy(), slopes.copy()
    if "background_per_sr" in present:
        light[:, 0] += value("background_per_sr")[:, None]
        if "background_per_sr" in values:
            slopes[:, names.index("background_per_sr"), 0] = 1.0
    if "analyzer_offset_rad" in present:
        twice = 2.0 * value("analyzer_offset_rad")
        light = _turned(light, twice, columns)
        slopes = _turned(slopes, twice, columns)
        if "analyzer_offset_rad" in values:
            # d/dα of a turn by 2α is twice the light that stands a quarter turn on.
            change = np.zeros_like(light)
            one, two = _rows(columns)
            change[..., one, :], change[..., two, :] = 2.0 * light[..., two, :], -2.0 * light[..., one, :]
            slopes[:, names.index("analyzer_offset_rad")] = change
    if "gain" in present:
        gain = value("gain")
        slopes = slopes * gain[:, None, None, None]
        if "gain" in values:
            slopes[:, names.index("gain")] = light
        light = light * gain[:, None, None]
    return light, slopes


def _rows(columns: int) -> tuple[slice, slice]:
    return slice(columns, 2 * columns), slice(2 * columns, 3 * columns)


def _turned(elements: FloatArray, angle: FloatArray, columns: int) -> FloatArray:
    shape = (-1,) + (1,) * (elements.ndim - 1)
    cosine, sine = np.cos(angle).reshape(shape), np.sin(angle).reshape(shape)
    turned = elements.copy()
    one, two = _rows(columns)
    turned[..., one, :] = cosine * elements[..., one, :] + sine * elements[..., two, :]
    turned[..., two, :] = cosine * elements[..., two, :] - sine * elements[..., one, :]
    return turned
