"""From the light behind analyzer states back to its Stokes parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.analyzer_matrix import CONDITION_LIMIT, AnalyzerState, analyzer_matrix, check_states
from goniometer.errors import ReductionError


def inverse_of(
    states: Sequence[AnalyzerState], rows: Sequence[NDArray[np.float64]] | None = None
) -> NDArray[np.float64]:
    """The least-squares inverse (3 or 4, N) of an analyzer matrix, all states weighing alike.

    Parameters
    ----------
    states : sequence of AnalyzerState
        N of them; the inverse has four rows where one of them, or of `rows`, depends on S3.
    rows : sequence of ndarray, optional
        What a calibration says of each of them, (3,) or (4,), in place of what ideal elements would do; as
        `SlotCalibration.rows` gives them.

    Raises
    ------
    ReductionError
        When the states do not tell the Stokes parameters that they depend on apart (`check_states`), or when the
        calibrated rows do not; or when there is not one for each state.
    """
    check_states(states)
    if rows is None:
        return np.asarray(np.linalg.pinv(analyzer_matrix(states)))
    if len(rows) != len(states):
        raise ReductionError(f"There are {len(rows)} calibrated rows for {len(states)} analyzer states; each needs one")
    matrix = np.zeros((len(rows), 4))
    for place, row in enumerate(rows):
        matrix[place, : len(row)] = row
    if not matrix[:, 3].any():
        matrix = matrix[:, : analyzer_matrix(states).shape[1]]
    values = np.linalg.svd(matrix, compute_uv=False)
    if len(matrix) < matrix.shape[1] or values[0] > CONDITION_LIMIT * values[-1]:
        raise ReductionError(
            f"the calibrated rows of the analyzer settings {', '.join(map(str, states))} do not tell the "
            f"{matrix.shape[1]} Stokes parameters that they depend on apart, although those of ideal elements do. "
            "Calibrate the analyzer anew"
        )
    return np.asarray(np.linalg.pinv(matrix))
