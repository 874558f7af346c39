"""From readings of known light to the angle, leak and transmission of each slot: weighted least squares.

`CalibrationProblem` has the equations. What readings do not determine is refused by name, before and after the
solution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.calibration_problem import CalibrationProblem, CalibrationScan, Floats
from acquisition.detector_noise import NoiseModel
from goniometer.errors import ReductionError

LARGEST_SCATTER = 5.0
"""Scatter of the readings about the solution, in units of the detector's noise, up to which a calibration is accepted.

Below, the errors are enlarged by it: an unsteady lamp, for example. Beyond, the readings are not of the reference.
"""

LARGEST_STDERR = {"angle_deg": 1.0, "leak": 0.02, "transmission": 0.02}
"""Errors beyond which nothing is gained by a calibration, because a polarizer's own are hardly larger."""

FARTHEST_DEG = 15.0
"""From the angle in the rig file; a polarizer farther off is another one, or the reference's angles count backwards."""

LARGEST_LEAK = 0.5
"""Of what may pass for a polarizer; one at 90 degrees to where the rig file has it leaks more than it passes."""

_MOST_ROUNDS, _SMALL = 50, 1e-6
_NULL = 1e-8
"""Relative singular value below which readings do not tell, and the share by which a parameter takes part in that."""
_TAKES_PART = 0.03


@dataclass(frozen=True)
class FoundSlots:
    """What was found: `values` (K, 3) of the K `slots` in the order of `PARAMETERS`, with `covariance` (3K, 3K).

    `dark_w` is the mean of the scans' dark powers with its standard error, None where there is no dark reading.
    """

    slots: tuple[int, ...]
    values: Floats
    covariance: Floats
    relative_to_slot: int
    dark_w: tuple[float, float] | None
    chi_square: float
    degrees_of_freedom: int


def solve_calibration(scans: Sequence[CalibrationScan], noise: NoiseModel) -> FoundSlots:
    """Solve scans of references for the slots of the analyzer.

    Parameters
    ----------
    scans : sequence of CalibrationScan
        All that were taken with one analyzer; at least one.
    noise : NoiseModel
        The detector's noise.

    Raises
    ------
    ReductionError
        When the scans do not determine what is asked, contradict the detector's noise, or show another analyzer.
    """
    problem = CalibrationProblem(scans)
    unknowns = problem.start()
    _refuse_undetermined(problem, problem.weighted(unknowns, noise)[1])
    for _ in range(_MOST_ROUNDS):
        residuals, slopes = problem.weighted(unknowns, noise)
        step = _inverse(slopes) @ residuals
        unknowns = unknowns + step
        if np.abs(slopes @ step).max() < _SMALL:
            break
    else:
        raise ReductionError(
            f"The readings lead to no solution within {_MOST_ROUNDS} rounds. Check that the reference's angles and the "
            "slots of the rig file are those that were measured."
        )
    residuals, slopes = problem.weighted(unknowns, noise)
    chi_square = float(residuals @ residuals)
    freedom = len(residuals) - int(slopes.any(axis=0).sum())
    _refuse_scatter(problem, residuals, freedom)
    inverse = _inverse(slopes)
    covariance = inverse @ inverse.T * max(1.0, chi_square / freedom)
    found = _found(problem, unknowns, covariance, chi_square, freedom)
    _refuse_result(problem, found)
    return found


def _found(
    problem: CalibrationProblem, unknowns: Floats, covariance: Floats, chi_square: float, freedom: int
) -> FoundSlots:
    """What a solution says of the slots."""
    of_slots, darks = slice(0, problem.powers), slice(problem.darks, problem.deviations)
    dark_w = None
    if problem.has_dark:
        stderr = math.sqrt(covariance[darks, darks].sum()) / len(problem.scans)
        dark_w = float(unknowns[darks].mean() * problem.scale_w), stderr * problem.scale_w
    return FoundSlots(
        problem.slots,
        unknowns[of_slots].reshape(-1, 3),
        covariance[of_slots, of_slots],
        problem.slots[0] if problem.open_slot is None else problem.open_slot,
        dark_w,
        chi_square,
        freedom,
    )


def _inverse(slopes: Floats) -> Floats:
    """Pseudo-inverse of columns of very different size; a column of zeros gets a row of zeros."""
    scale = np.linalg.norm(slopes, axis=0)
    is_seen = scale > 0.0
    inverse = np.zeros(slopes.shape[::-1])
    inverse[is_seen] = np.linalg.pinv(slopes[:, is_seen] / scale[is_seen]) / scale[is_seen, None]
    return inverse


def _refuse_undetermined(problem: CalibrationProblem, slopes: Floats) -> None:
    """Name the parameters that could be anything, for what the readings tell."""
    scale = np.linalg.norm(slopes, axis=0)
    in_vain = scale <= _NULL * scale.max()
    slopes[:, in_vain] = 0.0
    _, values, directions = np.linalg.svd(slopes / np.where(in_vain, 1.0, scale))
    null = directions[np.append(values, np.zeros(problem.count - len(values))) < _NULL * values[0]]
    takes_part = in_vain | (np.linalg.norm(null, axis=0) > _TAKES_PART)
    names = [problem.name(at) for at in range(problem.powers) if takes_part[at] and at != problem.fixed]
    if names:
        raise ReductionError(
            f"These scans cannot determine {', '.join(names)}: other values would give the same readings. Nothing was "
            "stored. A polarizer tells all of a slot at 4 or more angles that are spread over 180 degrees, for example "
            "0, 36, 72, 108, 144; at 3 where there is an open slot. A plate shows S1 alone, and so no more than a "
            "part: give scans of a polarizer beside it."
        )


def _refuse_scatter(problem: CalibrationProblem, residuals: Floats, freedom: int) -> None:
    scatter = math.sqrt(float(residuals @ residuals) / freedom)
    if scatter <= LARGEST_SCATTER:
        return
    worst = int(np.argmax(np.abs(residuals[: len(problem.readings)])))
    number, reading = problem.readings[worst]
    raise ReductionError(
        f"The readings scatter about the best solution {scatter:.0f} times as much as the detector's noise; at most "
        f"{LARGEST_SCATTER:g} times is accepted. The worst is slot {reading.slot} at point {reading.point} of "
        f"{problem.scans[number].name}, {residuals[worst]:.0f} standard deviations off. Nothing was stored. Check the "
        "reference's angles and the sense in which they count, its index, that nothing but the reference's light "
        "reaches the detector, that the lamp is steady, and the noise in the rig file."
    )


def _refuse_result(problem: CalibrationProblem, found: FoundSlots) -> None:
    stderrs = np.sqrt(np.diag(found.covariance)).reshape(-1, 3)
    for at, slot in enumerate(found.slots):
        nominal_deg, (angle_deg, leak, transmission) = problem.nominal_deg[slot], found.values[at]
        off_deg = math.remainder(angle_deg - nominal_deg, 180.0)
        if abs(off_deg) > FARTHEST_DEG or abs(leak) > LARGEST_LEAK or transmission <= 0.0:
            raise ReductionError(
                f"Slot {slot} was found at {angle_deg:.1f} degrees with a transmission of {transmission:.3g} and a "
                f"leak of {leak:.3g}; the rig file says a polarizer at {nominal_deg:g} degrees. Nothing was stored. "
                "Check which polarizer is in which slot, and in which sense the reference's angles count."
            )
        for which, (parameter, largest) in enumerate(LARGEST_STDERR.items()):
            if stderrs[at, which] > largest:
                raise ReductionError(
                    f"{problem.name(3 * at + which)} would be known to ± {stderrs[at, which]:.2g} ({parameter}); at "
                    f"most ± {largest:g} is of use. Nothing was stored. Take more readings or longer ones, spread the "
                    "reference's angles over 180 degrees, and know its zero better: a glass plate beside a polarizer "
                    "shows where s is."
                )
