"""Measured values with their covariances, as a fit takes them."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import FitError
from model.fit.observable import STOKES, Dolp, Elements, Observable, Ratios
from model.geometry import FloatArray

Objective = Literal["stokes", "normalised", "dolp", "rms"]
OBJECTIVES: tuple[Objective, ...] = ("stokes", "normalised", "dolp", "rms")
_ANGLES = ("incidence_rad", "exit_rad", "azimuth_rad")
# Of correlations, what rounding may make of an eigenvalue of 0.
_DEFINITE = 1e-13


@dataclass(frozen=True, eq=False)
class Dataset:
    """Values measured in N directions: by default the Stokes parameters S0, S1, S2 under unpolarized light.

    Parameters
    ----------
    incidence_rad, exit_rad, azimuth_rad : ndarray
        Shape (N,); angles from the normal from 0 to below pi/2, azimuth pi on the mirror side.
    values : ndarray
        Shape (N, M), of the observable; elements of light in 1/sr.
    covariance : ndarray or None
        Shape (N, M, M), of each row's values, positive definite; None if nobody knows, and then all values count alike
        and their scatter about the fit tells their error.
    observable : Observable
        What was measured.
    name : str
        What the data are called in messages, such as their file.
    lines : ndarray of int or None
        Shape (N,): in which line of that file each row stands; None if it is no text.

    Raises
    ------
    FitError
        If a shape is wrong, or a row is not finite, not above the horizon or has an impossible covariance.
    """

    incidence_rad: FloatArray
    exit_rad: FloatArray
    azimuth_rad: FloatArray
    values: FloatArray
    covariance: FloatArray | None = None
    observable: Observable = Elements()  # noqa: RUF009 (frozen)
    name: str = "the data"
    lines: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        count, width = len(self.values), len(self.observable.columns)
        if count == 0:
            raise FitError(f"There is no row in {self.name}. Nothing was fitted. Measure at least one direction.")
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(_ANGLES, (count,)) | {"values": (count, width)}
        if self.covariance is not None:
            shapes["covariance"] = (count, width, width)
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), dtype=np.float64)
            if values.shape != shape:
                raise FitError(
                    f"{name} has shape {values.shape}; {count} rows of data need {shape}. Nothing was fitted."
                )
            object.__setattr__(self, name, values)
        for name in shapes:
            finite = np.isfinite(getattr(self, name)).reshape(count, -1)
            self._refuse_rows(~finite.all(axis=1), f"{self._what(name, finite)} is not a finite number")
        for name in ("incidence_rad", "exit_rad"):
            values = getattr(self, name)
            angle = f"the {name.removesuffix('_rad')} angle"
            self._refuse_rows((values < 0.0) | (values >= np.pi / 2.0), f"{angle} is not from 0 to below 90°")
        if self.covariance is not None:
            asymmetric = np.abs(self.covariance - np.swapaxes(self.covariance, -1, -2)).max(axis=(1, 2), initial=0.0)
            scale = np.abs(self.covariance).max(axis=(1, 2), initial=0.0)
            self._refuse_rows(asymmetric > 1e-9 * scale, "the covariance is not symmetric")
            self._refuse_rows(~is_positive_definite(self.covariance), "the covariance is not positive definite")

    def __len__(self) -> int:
        return len(self.values)

    @property
    def directions(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Incidence, exit and azimuth, in rad."""
        return self.incidence_rad, self.exit_rad, self.azimuth_rad

    def some(self, rows: Sequence[int] | NDArray[np.bool_] | NDArray[np.int64]) -> Dataset:
        """The data of some rows alone."""
        picked = {name: getattr(self, name)[rows] for name in (*_ANGLES, "values")}
        covariance = None if self.covariance is None else self.covariance[rows]
        lines = None if self.lines is None else self.lines[rows]
        return replace(self, covariance=covariance, lines=lines, **picked)

    def joined(self, later: Dataset) -> Dataset:
        """These rows and those of other data of the same kind, which need not be looked over again.

        Raises
        ------
        ValueError
            If the two do not hold the same columns, or only one has errors.
        """
        if later.observable != self.observable or (later.covariance is None) != (self.covariance is None):
            raise ValueError("only data of the same columns, both with errors or both without, can be joined.")
        both = copy.copy(self)
        object.__setattr__(both, "lines", None)
        for name in (*_ANGLES, "values", "covariance", "whitener"):
            if getattr(self, name) is not None:
                object.__setattr__(both, name, np.concatenate([getattr(self, name), getattr(later, name)]))
        return both

    @cached_property
    def whitener(self) -> FloatArray:
        """Matrices (N, M, M), lower triangular, that turn each row's errors into independent ones of variance 1.

        Without covariances these are unit matrices.
        """
        if self.covariance is None:
            return np.broadcast_to(np.eye(self.values.shape[1]), (len(self), *[self.values.shape[1]] * 2))
        whitener: FloatArray = np.linalg.inv(np.linalg.cholesky(self.covariance))
        return whitener

    def compared_by(self, objective: Objective) -> Dataset:
        """The data in the form that an objective compares with the model, with errors propagated to first order.

        Parameters
        ----------
        objective : {"stokes", "normalised", "dolp", "rms"}
            The values as they are; divided by the first element; the degree of linear polarization; the same with equal
            weights, eq. (14) of Hao et al. 2023.

        Raises
        ------
        FitError
            If the data cannot be brought into that form.
        """
        if objective == "stokes" or (objective == "normalised" and isinstance(self.observable, Ratios)):
            return self
        if objective == "rms" and isinstance(self.observable, Dolp):
            return replace(self, covariance=None)
        if objective == "dolp" and isinstance(self.observable, Dolp):
            return self
        target = self._target(objective)
        values, jacobian = self._transformed(target)
        covariance = None
        if self.covariance is not None and objective != "rms":
            covariance = jacobian @ self.covariance @ np.swapaxes(jacobian, -1, -2)
        return replace(self, values=values, covariance=covariance, observable=target)

    def _target(self, objective: Objective) -> Observable:
        measured = self.observable
        if isinstance(measured, Elements) and measured.picked[:1] == (0,):
            if objective == "normalised" and len(measured.picked) > 1:
                return Ratios(measured.picked[1:], measured.elements)
            if objective in ("dolp", "rms") and measured.elements == STOKES and measured.picked[:3] == (0, 1, 2):
                return Dolp()
        raise FitError(
            f"The objective {objective} cannot be had from {self.name}, which hold {', '.join(measured.columns)}. "
            f"Nothing was fitted. Choose the objective stokes, which compares the values as they are."
        )

    def _transformed(self, target: Observable) -> tuple[FloatArray, FloatArray]:
        """Values (N, M') of another observable, and their derivatives (N, M', M) by the values measured."""
        measured = self.observable
        self._refuse_rows(
            self.values[:, 0] <= 0.0,
            f"{measured.columns[0]} is not above 0, so that nothing can be divided by it",
            "Fit with the objective stokes, which takes the values as they are; or leave the row out.",
        )
        assert isinstance(measured, Elements), "only elements can be made into something else"
        light = np.zeros((target.elements, len(self)))
        slopes = np.zeros((len(measured.picked), *light.shape))
        light[list(measured.picked)] = self.values.T
        for place, element in enumerate(measured.picked):
            slopes[place, element] = 1.0
        values, changes = target.of(light, slopes)
        if isinstance(target, Dolp):
            # Where nothing is polarized the DoLP has the error of S1 and S2, though no derivative.
            dark = values[0] == 0.0
            changes[1, 0, dark] = 1.0 / self.values[dark, 0]
        return values.T.copy(), np.moveaxis(changes, -1, 0).swapaxes(1, 2).copy()

    def _what(self, name: str, finite: NDArray[np.bool_]) -> str:
        if name != "values" or finite.all():
            return name
        return self.observable.columns[int(np.argmin(finite.all(axis=0)))]

    def place(self, row: int) -> str:
        """Where a row stands, for a person: its line in a file of text, else its number, counted from 0."""
        return f"row {row}" if self.lines is None else f"line {self.lines[row]}"

    def _refuse_rows(
        self, bad: NDArray[np.bool_], what: str, remedy: str = "Leave the row out or measure it again."
    ) -> None:
        if bad.any():
            row = int(np.argmax(bad))
            angles = (np.degrees(angle[row]) for angle in self.directions)
            where = "incidence {:.6g}°, exit {:.6g}°, azimuth {:.6g}°".format(*angles)
            others = f", and {int(bad.sum()) - 1} more" if bad.sum() > 1 else ""
            raise FitError(
                f"{self.place(row).capitalize()} of {self.name} ({where}){others}: {what}. Nothing was fitted. {remedy}"
            )


def is_positive_definite(covariance: FloatArray) -> NDArray[np.bool_]:
    """Which covariances (..., M, M) leave no sum of values without an error, whatever units the values are in."""
    variance = np.einsum("...ii->...i", covariance)
    above = (variance > 0.0).all(axis=-1)
    stderr = np.sqrt(np.where(above[..., None], variance, 1.0))
    correlation = covariance / (stderr[..., :, None] * stderr[..., None, :])
    definite: NDArray[np.bool_] = above & (np.linalg.eigvalsh(correlation)[..., 0] > _DEFINITE)
    return definite
