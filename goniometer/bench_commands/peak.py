"""The centre of a symmetric peak, and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from goniometer.errors import FitError

_FEWEST_AT_THE_TOP = 5
_LEAST_HEIGHT_IN_ERRORS = 10.0
_OUTLIER_IN_SIGMAS = 6.0
_SIGMA_PER_MEDIAN = 1.4826
_MOST_LEFT_OUT = 0.1
_LEAST_RELATIVE_ERROR = 1e-4
_MOST_ASYMMETRY = 0.05

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Peak:
    """A peak on a constant background.

    Attributes
    ----------
    centre_deg, stderr_deg : float
        Its centre, and the standard error that the residuals give it.
    shift_deg : float
        By how much the centre moves when the upper half of the peak is fitted alone: 0 for a symmetric one.
    fwhm_deg : float
        Its full width at half of its height.
    height_w, background_w : float
        Its height above the background, and the background.
    left_out : tuple of float
        The angles of points that were left out of the fit, because they stand far off it.
    """

    centre_deg: float
    stderr_deg: float
    shift_deg: float
    fwhm_deg: float
    height_w: float
    background_w: float
    left_out: tuple[float, ...] = ()

    @property
    def uncertainty_deg(self) -> float:
        """Standard error and asymmetry together."""
        return float(np.hypot(self.stderr_deg, self.shift_deg))


def fit_peak(angle_deg: Floats, power_w: Floats, stddev_w: Floats) -> Peak:
    """Fit a symmetric peak: background + height · 2^(-|2 (angle - centre) / fwhm|^p), weighted.

    The power p lets the top be as sharp or flat as it is; the centre does not depend on it, because the peak is
    symmetric. Points that stand far off are left out, and the error comes from the residuals of the others.

    Parameters
    ----------
    angle_deg, power_w, stddev_w : ndarray of shape (N,)
        The scan in the order of its angles, and the standard deviation of each power, >= 0.

    Raises
    ------
    FitError
        When the scan is flat, saturated or too coarse, when the peak is not wholly inside it, or not symmetric.
    """
    _refuse_plateau(angle_deg, power_w)
    peak = _robust(angle_deg, power_w, np.maximum(stddev_w, _LEAST_RELATIVE_ERROR * np.max(np.abs(power_w))))
    _refuse_edge(peak, angle_deg)
    top = np.abs(angle_deg - peak.centre_deg) <= peak.fwhm_deg / 2
    top &= ~np.isin(angle_deg, peak.left_out)
    if np.count_nonzero(top) < _FEWEST_AT_THE_TOP:
        raise FitError(
            f"The scan is too coarse: {np.count_nonzero(top)} of its points lie above half of the peak's height, and "
            f"{_FEWEST_AT_THE_TOP} are needed. The peak is {peak.fwhm_deg:.3g} degrees wide: give a --step of "
            f"{peak.fwhm_deg / (2 * _FEWEST_AT_THE_TOP):.2g} or less"
        )
    centre_deg, stderr_deg = _centre_of_top(angle_deg[top], power_w[top], peak)
    peak = replace(peak, shift_deg=centre_deg - peak.centre_deg)
    if abs(peak.shift_deg) > max(_MOST_ASYMMETRY * peak.fwhm_deg, 4 * stderr_deg):
        raise FitError(
            f"The peak is not symmetric: its upper half has its centre at {centre_deg:.3f} degrees, all of it at "
            f"{peak.centre_deg:.3f}. The centre of such a peak is not the mirror direction, as with a rough sample: "
            "put a mirror in the sample's place"
        )
    return peak


def _robust(angle_deg: Floats, power_w: Floats, stddev_w: Floats) -> Peak:
    used = np.ones(angle_deg.size, bool)
    while True:
        peak, residuals = _fitted(angle_deg[used], power_w[used], stddev_w[used])
        farthest = int(np.argmax(np.abs(residuals)))  # one by one, for one that is far off draws the fit to itself
        is_off = abs(residuals[farthest]) > _OUTLIER_IN_SIGMAS * _SIGMA_PER_MEDIAN * np.median(np.abs(residuals))
        if not is_off or np.count_nonzero(~used) + 1 > _MOST_LEFT_OUT * angle_deg.size:
            return replace(peak, left_out=tuple(angle_deg[~used].tolist()))
        used[np.flatnonzero(used)[farthest]] = False


def _fitted(angle_deg: Floats, power_w: Floats, stddev_w: Floats) -> tuple[Peak, Floats]:
    """One weighted fit; returns the residuals in standard deviations, too."""
    scale_w = float(np.ptp(power_w))
    if scale_w == 0.0:
        raise _flat("every point has the same power")
    background_w = float(np.min(power_w))
    high = power_w > background_w + scale_w / 2
    step_deg, span_deg = float(np.min(np.diff(angle_deg))), float(np.ptp(angle_deg))

    def residuals(parameters: Floats) -> Floats:
        centre, fwhm, exponent, height, background = parameters
        peak = background + height * np.exp2(-(np.abs(2 * (angle_deg - centre) / fwhm) ** exponent))
        return np.asarray((power_w - background_w - scale_w * peak) / stddev_w, np.float64)

    start = [float(np.mean(angle_deg[high])), min(np.count_nonzero(high) * step_deg, span_deg), 2.0, 1.0, 0.0]
    lowest, highest = [angle_deg[0], 0.5 * step_deg, 0.7, 0.0, -2.0], [angle_deg[-1], 2 * span_deg, 30.0, 5.0, 2.0]
    found = least_squares(
        residuals, np.clip(start, lowest, highest), bounds=(lowest, highest), x_scale=[step_deg, step_deg, 1, 0.1, 0.1]
    )
    spread = 2 * found.cost / max(angle_deg.size - len(start), 1)
    errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(found.jac.T @ found.jac)) * spread, 0.0))
    centre_deg, fwhm_deg, _, height, background = map(float, found.x)
    if not height > _LEAST_HEIGHT_IN_ERRORS * errors[3]:
        raise _flat(
            f"the highest point is {scale_w:.3g} W above the lowest, and no peak with both sides stands out of the rest"
        )
    peak = Peak(centre_deg, float(errors[0]), 0.0, fwhm_deg, height * scale_w, background_w + background * scale_w)
    return peak, np.asarray(found.fun, np.float64)


def _centre_of_top(angle_deg: Floats, power_w: Floats, peak: Peak) -> tuple[float, float]:
    """Centre, and its standard error, of a polynomial through the upper half: even but for its centre."""
    offset = (angle_deg - peak.centre_deg) / peak.fwhm_deg

    def residuals(parameters: Floats) -> Floats:
        centre, height, curvature, quartic = parameters
        square = (offset - centre) ** 2
        return np.asarray(height + curvature * square + quartic * square**2 - power_w / peak.height_w, np.float64)

    found = least_squares(residuals, [0.0, 1.0 + peak.background_w / peak.height_w, -2.0, 0.0])
    spread = 2 * found.cost / max(offset.size - 4, 1)
    variance = float(np.linalg.pinv(found.jac.T @ found.jac)[0, 0]) * spread
    return peak.centre_deg + float(found.x[0]) * peak.fwhm_deg, float(np.sqrt(variance)) * peak.fwhm_deg


def _refuse_plateau(angle_deg: Floats, power_w: Floats) -> None:
    highest = np.flatnonzero(power_w == np.max(power_w))
    if 3 <= highest.size < power_w.size:
        raise FitError(
            f"The detector was saturated: {highest.size} points from {angle_deg[highest[0]]:g} to "
            f"{angle_deg[highest[-1]]:g} degrees have exactly the same power, {np.max(power_w):.4g} W. Weaken the "
            "beam, or use a sensor for more power"
        )


def _refuse_edge(peak: Peak, angle_deg: Floats) -> None:
    half_deg = peak.fwhm_deg / 2
    if not angle_deg[0] <= peak.centre_deg - half_deg <= peak.centre_deg + half_deg <= angle_deg[-1]:
        raise FitError(
            f"The peak is at the edge of the scan: its upper half lies from {peak.centre_deg - half_deg:.3g} to "
            f"{peak.centre_deg + half_deg:.3g} degrees, the scan from {angle_deg[0]:g} to {angle_deg[-1]:g}. Move "
            "--from and --to so that both sides of the peak are inside"
        )


def _flat(why: str) -> FitError:
    return FitError(
        f"The scan is flat: {why}. Check that the beam is on, that the analyzer lets light through, and that the "
        "mirror direction lies inside the scan, with both sides of the peak"
    )
