"""Measured Stokes parameters with their covariances, as a fit takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import FitError
from model.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class StokesData:
    """Stokes parameters S0, S1, S2 of N directions under unpolarized light.

    Parameters
    ----------
    incidence_rad, exit_rad, azimuth_rad : ndarray
        Shape (N,); angles from the normal from 0 to below pi/2, azimuth pi on the mirror side.
    stokes : ndarray
        Shape (N, 3), in 1/sr.
    covariance : ndarray
        Shape (N, 3, 3), of each row's three values; positive definite.

    Raises
    ------
    FitError
        If a shape is wrong, or a row is not finite, not above the horizon or has an impossible covariance.
    """

    incidence_rad: FloatArray
    exit_rad: FloatArray
    azimuth_rad: FloatArray
    stokes: FloatArray
    covariance: FloatArray

    def __post_init__(self) -> None:
        count = len(self.stokes)
        if count == 0:
            raise FitError("There is no row of Stokes data. Nothing was fitted. Measure at least one direction.")
        shapes: dict[str, tuple[int, ...]] = {"stokes": (count, 3), "covariance": (count, 3, 3)}
        shapes |= dict.fromkeys(("incidence_rad", "exit_rad", "azimuth_rad"), (count,))
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), dtype=np.float64)
            if values.shape != shape:
                raise FitError(
                    f"{name} has shape {values.shape}; {count} rows of data need {shape}. Nothing was fitted."
                )
            object.__setattr__(self, name, values)
        for name in shapes:
            finite = np.isfinite(getattr(self, name)).reshape(count, -1).all(axis=1)
            self._refuse_rows(~finite, f"{name} is not a finite number")
        for name in ("incidence_rad", "exit_rad"):
            values = getattr(self, name)
            self._refuse_rows((values < 0.0) | (values >= np.pi / 2.0), f"{name} is not from 0 to below pi/2")
        asymmetric = np.abs(self.covariance - np.swapaxes(self.covariance, -1, -2)).max(axis=(1, 2), initial=0.0)
        scale = np.abs(self.covariance).max(axis=(1, 2), initial=0.0)
        self._refuse_rows(asymmetric > 1e-9 * scale, "the covariance is not symmetric")
        smallest = np.linalg.eigvalsh(self.covariance)[:, 0]
        self._refuse_rows(smallest <= 0.0, "the covariance is not positive definite")

    def whitener(self) -> FloatArray:
        """Matrices (N, 3, 3) that turn each row's errors into independent ones of variance 1."""
        whitener: FloatArray = np.linalg.inv(np.linalg.cholesky(self.covariance))
        return whitener

    def _refuse_rows(self, bad: NDArray[np.bool_], what: str) -> None:
        if bad.any():
            row = int(np.argmax(bad))
            angles = (np.degrees(angle[row]) for angle in (self.incidence_rad, self.exit_rad, self.azimuth_rad))
            where = "incidence {:.6g}°, exit {:.6g}°, azimuth {:.6g}°".format(*angles)
            raise FitError(
                f"Row {row} of the Stokes data ({where}): {what}. Nothing was fitted. "
                f"Leave the row out or measure it again."
            )
