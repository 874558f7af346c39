"""The picture of a scan: what was measured, the fit, what is left over, and the parameters with their errors."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from acquisition.readings import StokesPoint
from acquisition.whole_file import written_whole
from goniometer.fit_summary import parameter_rows, quality
from model.fit import FitResult
from model.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, told apart with any colour vision
_DATA, _FIT, _WARNING = "#0072B2", "#D55E00", "#B8860B"
_INK, _FAINT, _BAND = "#222222", "#6f6f6f", "#ececec"
_STYLE = {
    "font.size": 9.0,
    "text.color": _INK,
    "axes.labelcolor": _INK,
    "axes.edgecolor": "#888888",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.7,
}
_SYMBOLS = {"sigma": "σ", "rho_s": r"$\rho_\mathrm{s}$", "rho_d": r"$\rho_\mathrm{d}$", "rho_dd": r"$\rho_\mathrm{dd}$"}
_MEANINGS = {
    "sigma": "roughness, rms slope",
    "n": "refractive index",
    "k": "extinction",
    "rho_s": "specular weight",
    "rho_d": "diffuse weight",
    "rho_dd": "directional weight",
}
_CROWDED = 150
"""Number of points above which they are drawn small and faint, so that the fit stays visible."""


@dataclass(frozen=True)
class _Quantity:
    """One measured quantity along the scan, with the fit's values where there is a fit; arrays of shape (N,)."""

    label: str
    measured: FloatArray
    stderr: FloatArray
    fitted: FloatArray | None
    period: float | None = None

    def residuals(self) -> FloatArray:
        """Measured less fitted in standard errors, by the shorter way round where the quantity is an angle."""
        difference = self.measured - (np.nan if self.fitted is None else self.fitted)
        if self.period is not None:
            difference = (difference + self.period / 2.0) % self.period - self.period / 2.0
        return difference / self.stderr
