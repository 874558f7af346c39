"""Variable projection: a surface is linear in its lobes' weights, so only roughness and index need a search.

For given shape parameters the best weights follow from a non-negative linear least-squares problem; what that leaves is
the residual that a search over the shape parameters minimises (Golub and Pereyra 1973).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from model.family import SurfaceFamily
from model.geometry import FloatArray
from model.stokes_data import StokesData

# A lobe whose light is this much weaker than the strongest lobe's, at equal weight, is not seen by the data.
_INVISIBLE = 1e-12


class Projection:
    """The fit of a family's surfaces to data, as a function of the shape parameters alone.

    Searches run in the unit box: sigma is spaced by its logarithm between its bounds, n and k evenly.

    Parameters
    ----------
    data : StokesData
        Measured values, N rows.
    family : SurfaceFamily
        Surfaces to choose from.
    """

    def __init__(self, data: StokesData, family: SurfaceFamily) -> None:
        self.family = family
        self.dimension = len(family.shapes)
        self.rows = len(data.stokes)
        self._directions = data.incidence_rad, data.exit_rad, data.azimuth_rad
        self._whitener = data.whitener()
        self._target = self._whiten(data.stokes[..., None])[:, 0]

    def shapes(self, unit: FloatArray) -> dict[str, float]:
        """Shape parameters at a point of the unit box."""
        values = {}
        for name, u in zip(self.family.shapes, unit, strict=True):
            low, high = self.family.free[name]
            value = low * (high / low) ** u if name == "sigma" else low + (high - low) * u
            values[name] = float(min(max(value, low), high))  # a bound's rounding must not lie outside it
        return values

    def unit(self, parameters: dict[str, float]) -> FloatArray:
        """The point of the unit box where the shape parameters have these values."""
        unit = []
        for name in self.family.shapes:
            low, high = self.family.free[name]
            value = parameters[name]
            unit.append(np.log(value / low) / np.log(high / low) if name == "sigma" else (value - low) / (high - low))
        return np.array(unit, dtype=np.float64)

    def slopes(self, unit: FloatArray) -> FloatArray:
        """How fast each shape parameter changes with its unit coordinate."""
        slopes = []
        for name, value in self.shapes(unit).items():
            low, high = self.family.free[name]
            slopes.append(value * np.log(high / low) if name == "sigma" else high - low)
        return np.array(slopes, dtype=np.float64)

    def light(self, unit: FloatArray) -> FloatArray:
        """Stokes parameters of every lobe at weight 1, shape (N, 3, lobes)."""
        shapes = self.shapes(unit)
        lobes = [self.family.lobe(name, 1.0, shapes) for name in self.family.lobes]
        # Light is linear in the weights: what a lobe sends at weight 1 is how fast the sum changes with it.
        light = self.family.seen(lobes).jacobian(self.family.weights, *self._directions)[:, :3]
        return np.asarray(light, np.float64)

    def columns(self, unit: FloatArray) -> FloatArray:
        """The same, whitened, shape (3N, lobes)."""
        return self._whiten(self.light(unit))

    def weights(self, columns: FloatArray) -> FloatArray:
        """Best non-negative weights of the lobes, shape (lobes,)."""
        lengths = np.sqrt(np.einsum("ij,ij->j", columns, columns))
        seen = lengths > _INVISIBLE * lengths.max()
        weights = np.zeros(len(lengths))
        if seen.any():
            weights[seen] = nnls(columns[:, seen] / lengths[seen], self._target)[0] / lengths[seen]
        return weights

    def residuals(self, unit: FloatArray) -> FloatArray:
        """Whitened differences between surface and data at the best weights, shape (3N,)."""
        columns = self.columns(unit)
        residuals: FloatArray = columns @ self.weights(columns) - self._target
        return residuals

    def chi_square(self, unit: FloatArray) -> float:
        """Sum of the squared residuals."""
        residuals = self.residuals(unit)
        return float(residuals @ residuals)

    def _whiten(self, stokes: FloatArray) -> FloatArray:
        return (self._whitener @ stokes).reshape(3 * self.rows, -1)
