"""Degrees and angle of polarization of a measured Stokes vector, with first-order errors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.readings import Reading, StokesPoint
from model.stokes import aolp

_UNKNOWN_AOLP_STDERR_DEG = 180.0 / math.sqrt(12.0)
"""Standard deviation of an angle that may be anything within 180 degrees."""


def stokes_point(reading: Reading, stokes: NDArray[np.float64], covariance: NDArray[np.float64]) -> StokesPoint:
    """The Stokes point of a direction, with what follows from its Stokes vector.

    The debiased degree is the modified asymptotic estimator of Plaszczynski et al. (2014): it never goes negative and
    tends to p - b²/(2p) for a clear signal, where b² is the variance across the polarization's direction.

    Parameters
    ----------
    reading : Reading
        Any of the direction's readings, for its angles.
    stokes, covariance : ndarray
        Shapes (3,) and (3, 3), or (4,) and (4, 4), in 1/sr and 1/sr².
    """
    s0, s1, s2 = stokes[:3]
    polarized = math.hypot(s1, s2)
    dolp = debiased = dolp_stderr = math.nan
    aolp_stderr_deg = _UNKNOWN_AOLP_STDERR_DEG
    if s0 > 0.0:
        dolp = polarized / s0
        along = np.array([s1, s2]) / polarized if polarized > 0.0 else np.array([1.0, 0.0])
        across = np.array([-along[1], along[0]])
        ratio_covariance = _ratio_covariance(stokes[:3], covariance[:3, :3])
        dolp_stderr = math.sqrt(along @ ratio_covariance @ along)
        bias_variance = float(across @ ratio_covariance @ across)
        debiased = dolp
        if dolp > 0.0:
            debiased += bias_variance * math.expm1(-(dolp**2) / bias_variance) / (2.0 * dolp)
            aolp_stderr_deg = min(aolp_stderr_deg, math.degrees(math.sqrt(bias_variance) / (2.0 * dolp)))
    return StokesPoint(
        point=reading.point,
        incidence_deg=reading.incidence_deg,
        exit_deg=reading.exit_deg,
        azimuth_deg=reading.azimuth_deg,
        exit_azimuth_deg=reading.exit_azimuth_deg,
        wavelength_nm=reading.wavelength_nm,
        stokes=stokes,
        covariance=covariance,
        dolp=dolp,
        dolp_debiased=debiased,
        dolp_stderr=dolp_stderr,
        aolp_deg=math.degrees(float(aolp(stokes))),
        aolp_stderr_deg=aolp_stderr_deg,
        **(_with_s3(stokes, covariance) if len(stokes) == 4 else {}),
    )


def _with_s3(stokes: NDArray[np.float64], covariance: NDArray[np.float64]) -> dict[str, Any]:
    """Degrees of circular and of all polarization; NaN where noise has made S0 negative."""
    if stokes[0] <= 0.0:
        return dict.fromkeys(("docp", "docp_stderr", "dop", "dop_stderr"), math.nan)
    ratios, ratio_covariance = stokes[1:] / stokes[0], _ratio_covariance(stokes, covariance)
    dop = float(np.linalg.norm(ratios))
    along = ratios / dop if dop > 0.0 else np.array([1.0, 0.0, 0.0])
    return {
        "docp": float(ratios[2]),
        "docp_stderr": math.sqrt(ratio_covariance[2, 2]),
        "dop": dop,
        "dop_stderr": math.sqrt(along @ ratio_covariance @ along),
    }


def _ratio_covariance(stokes: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance of the Stokes parameters from the second on, divided by S0."""
    to_ratios = np.column_stack([-stokes[1:] / stokes[0], np.eye(len(stokes) - 1)]) / stokes[0]
    return np.asarray(to_ratios @ covariance @ to_ratios.T)
