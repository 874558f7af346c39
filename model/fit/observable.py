"""What is compared with a surface's light: elements of it, ratios of elements, the degree of linear polarization."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from model.geometry import FloatArray

STOKES, MUELLER = 4, 16
"""How many elements light has: a Stokes vector under unpolarized light, or a Mueller matrix, row by row."""


_CANCELLED = 1e-13
"""Of the difference of two terms, what share of them is rounding."""


class Observable(ABC):
    """Values that follow from the elements of light in one direction, and how fast they change with these."""

    elements: int

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """Names of the values."""

    @abstractmethod
    def of(self, light: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values (..., M, N) and their derivatives (..., P, M, N) from light (..., E, N) and slopes (..., P, E, N)."""

    @property
    def has_scale(self) -> bool:
        """Whether the values say how much light there is."""
        return True

    @property
    def is_linear(self) -> bool:
        """Whether the values are sums of lobes, each proportional to its weight."""
        return self.has_scale


class RatioObservable(Observable):
    """Values that do not say how much light there is: ratios of light, and what follows from these."""

    @property
    def has_scale(self) -> bool:
        """Whether the values say how much light there is: not these."""
        return False

    @abstractmethod
    def condition(self, light: FloatArray, measured: FloatArray) -> FloatArray:
        """Numbers (b, M, E, N) whose products with light, summed over its elements, are 0 where it has these values.

        For light close to the one that is given, (b, E, N), they are its values less those measured, (b, M, N).
        """


@dataclass(frozen=True)
class Elements(Observable):
    """Some elements of the light as they are.

    Parameters
    ----------
    picked : tuple of int
        Which, counted row by row.
    elements : int
        `STOKES` or `MUELLER`.
    """

    picked: tuple[int, ...] = (0, 1, 2)
    elements: int = STOKES

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the values."""
        return tuple(_name(place, self.elements) for place in self.picked)

    def of(self, light: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and derivatives; see `Observable.of`."""
        picked = list(self.picked)
        if picked == list(range(len(picked))):
            return light[..., : len(picked), :], slopes[..., : len(picked), :]
        return light[..., picked, :], slopes[..., picked, :]


@dataclass(frozen=True)
class Ratios(RatioObservable):
    """Some elements of the light, divided by the first; they do not say how much light there is.

    Parameters
    ----------
    picked : tuple of int
        Which, counted row by row.
    elements : int
        `STOKES` or `MUELLER`.
    """

    picked: tuple[int, ...] = (1, 2)
    elements: int = STOKES

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the values."""
        first = _name(0, self.elements)
        return tuple(f"{_name(place, self.elements)}/{first}" for place in self.picked)

    def of(self, light: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and derivatives; see `Observable.of`."""
        picked = list(self.picked)
        inverse = 1.0 / light[..., :1, :]
        values = light[..., picked, :] * inverse
        changes = _less(slopes[..., picked, :], values[..., None, :, :] * slopes[..., :1, :])
        return values, changes * inverse[..., None, :, :]

    def condition(self, light: FloatArray, measured: FloatArray) -> FloatArray:
        """What light with these ratios obeys; see `RatioObservable.condition`."""
        inverse = 1.0 / light[:, :1]
        condition = np.zeros((len(light), len(self.picked), *light.shape[1:]))
        condition[:, range(len(self.picked)), self.picked] = inverse
        condition[:, :, 0] -= measured * inverse
        return condition


@dataclass(frozen=True)
class Dolp(RatioObservable):
    """The degree of linear polarization under unpolarized light, √(S1² + S2²)/S0."""

    elements: int = STOKES

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the values."""
        return ("dolp",)

    def of(self, light: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and derivatives; see `Observable.of`."""
        s0, s1, s2 = (light[..., i : i + 1, :] for i in range(3))
        polarized = np.hypot(s1, s2)
        # Unpolarized light has a DoLP of 0 and no slope: whichever way it changes, the DoLP rises.
        toward = 1.0 / np.where(polarized > 0.0, polarized, np.inf)
        dolp = polarized / s0
        ds0, ds1, ds2 = (slopes[..., i : i + 1, :] for i in range(3))
        along = (s1 * toward)[..., None, :, :] * ds1 + (s2 * toward)[..., None, :, :] * ds2
        return dolp, _less(along, dolp[..., None, :, :] * ds0) / s0[..., None, :, :]

    def condition(self, light: FloatArray, measured: FloatArray) -> FloatArray:
        """What light with this DoLP and its own azimuth of polarization obeys; see `RatioObservable.condition`."""
        s0, s1, s2 = light[:, 0], light[:, 1], light[:, 2]
        polarized = np.hypot(s1, s2)
        condition = np.zeros((len(light), 1, *light.shape[1:]))
        condition[:, 0, 0] = -measured[:, 0] / s0
        condition[:, 0, 1], condition[:, 0, 2] = s1 / (polarized * s0), s2 / (polarized * s0)
        return condition


def _less(one: FloatArray, other: FloatArray) -> FloatArray:
    """The difference, and 0 where nothing of it is left but rounding: there a ratio does not change."""
    left = one - other
    return np.where(np.abs(left) > _CANCELLED * np.abs(one), left, 0.0)


def _name(place: int, elements: int) -> str:
    return f"s{place}" if elements == STOKES else f"m{place // 4}{place % 4}"
