"""How the elements of a Mueller matrix mix into readings, a state of the generator and one of the analyzer each.

A reading behind the analyzer's row a of light with the generator's column g tells a · M g: one number of M's elements,
a_i g_j of each. Without a generator g is (1), and M its first column, the Stokes parameters under unpolarized light.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.analyzer_matrix import CONDITION_LIMIT, AnalyzerState, analyzer_matrix, check_states
from acquisition.generator import GeneratorState, generator_matrix
from goniometer.errors import ReductionError

Setting = tuple[AnalyzerState, GeneratorState]
"""What stands before the detector, and what light is on the sample."""


def settings_shape(settings: Sequence[Setting]) -> tuple[int, int]:
    """Of how many rows and columns of the Mueller matrix readings in these settings tell; (3, 1) to (4, 4)."""
    analyzers, generators = zip(*settings, strict=True) if settings else ((), ())
    return analyzer_matrix(analyzers).shape[1], generator_matrix(generators).shape[1]


def settings_matrix(rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """What of each element, row by row, is in readings: (N, I·J) of rows (N, I) and the generator's columns (N, J)."""
    return (rows[:, :, None] * columns[:, None, :]).reshape(len(rows), -1)


def condition(settings: Sequence[Setting]) -> float:
    """By how much relative errors of readings may be enlarged on their way to the elements; infinite if never told."""
    analyzers, generators = zip(*settings, strict=True)
    matrix = settings_matrix(analyzer_matrix(analyzers), generator_matrix(generators))
    values = np.linalg.svd(matrix, compute_uv=False)
    is_determined = len(matrix) >= matrix.shape[1] and values[-1] > 1e-8 * values[0]
    return float(values[0] / values[-1]) if is_determined else np.inf


def check_settings(settings: Sequence[Setting]) -> None:
    """Refuse settings that do not tell the elements that they depend on apart.

    Raises
    ------
    ReductionError
        When the analyzer's states or the generator's do not, each by themselves; when they would, and too few pairs of
        them are there; or when the condition number is above `CONDITION_LIMIT`.
    """
    analyzers = list(dict.fromkeys(analyzer for analyzer, _ in settings))
    generators = list(dict.fromkeys(generator for _, generator in settings))
    check_states(analyzers)
    if generator_matrix(generators).shape[1] == 1:
        return
    check_states([generator.reversed for generator in generators], element="generator")
    found = condition(settings)
    if found == np.inf:
        rows, columns = settings_shape(settings)
        raise ReductionError(
            f"{len(set(settings))} pairs of generator and analyzer settings do not tell the {rows * columns} elements "
            f"of the Mueller matrix apart. Read every analyzer setting behind every generator setting"
        )
    if found > CONDITION_LIMIT:
        raise ReductionError(
            f"errors of the readings reach the Mueller matrix enlarged up to {found:.0f} times (condition number of "
            f"the generator and analyzer settings together; at most {CONDITION_LIMIT:g} is accepted). Spread the "
            "angles over 180 degrees, those of retarders too"
        )
