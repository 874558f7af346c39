"""From the scans of a calibration to what is stored of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import yaml

from acquisition.calibrated_slots import SlotCalibration
from acquisition.solve_calibration import FoundSlots, solve_calibration
from goniometer.calibrating.stored_scan import StoredScan
from goniometer.calibration_checks import analyzer_name, drivers
from goniometer.errors import ReductionError
from goniometer.planning import noise

_DIGITS, _CORRELATION_DECIMALS = 9, 7


def solved(scans: Sequence[StoredScan]) -> SlotCalibration:
    """Solve scans that were taken of one analyzer.

    Raises
    ------
    ReductionError
        When they are of different benches or wavelengths, or cannot be solved.
    """
    first = scans[0]
    for other in scans[1:]:
        if (of_bench(other), other.recipe.wavelength_nm) != (of_bench(first), first.recipe.wavelength_nm):
            raise ReductionError(
                f"{other.scan.name} and {first.scan.name} are of different benches, slots or wavelengths. Nothing was "
                "stored. Give scans of one analyzer at one wavelength."
            )
    found = solve_calibration([scan.scan for scan in scans], noise(first.rig, first.recipe.wavelength_nm))
    references = dict.fromkeys(str(scan.recipe.calibrate) for scan in scans)
    return SlotCalibration(
        calibration=", ".join(dict.fromkeys(scan.recipe.recipe for scan in scans)),
        measured=min(scan.started for scan in scans).isoformat(timespec="seconds"),
        **of_bench(first),
        wavelength_nm=first.recipe.wavelength_nm,
        reference="; ".join(references),
        scans=tuple(f"{scan.scan.name}, recipe's SHA-256 {scan.recipe_sha256}" for scan in scans),
        **_of_slots(found, first),
    )


def of_bench(scan: StoredScan) -> dict[str, Any]:
    """What makes a calibration one of this bench."""
    return {
        "rig": scan.rig.rig,
        "devices": drivers(scan.rig),
        "analyzer": analyzer_name(scan.rig),
        "offset_deg": scan.rig.analyzer.offset_deg,
        "layout": dict(scan.rig.analyzer.contents()),
    }


def calibration_text(calibration: SlotCalibration) -> str:
    """A calibration as a YAML file."""
    content = calibration.model_dump(exclude_none=True)
    listed = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=10_000)
    return (
        "# What goniometer calibrate has found of an analyzer; docs/calibration.md says what it means.\n"
        "# A recipe uses it with the keys calibration and calibration_max_age_days.\n" + listed
    )


def _of_slots(found: FoundSlots, scan: StoredScan) -> dict[str, Any]:
    contents = scan.rig.analyzer.contents()
    stderrs = np.sqrt(np.diag(found.covariance))
    units = np.where(stderrs > 0.0, stderrs, 1.0)
    correlation = found.covariance / np.outer(units, units)
    np.fill_diagonal(correlation, 1.0)
    slots = {
        slot: {
            "holds": contents[slot],
            **{
                key: _rounded(number)
                for name, value, stderr in zip(("angle", "leak", "transmission"), values, errors, strict=True)
                for key, number in _pair(name, value, stderr)
            },
        }
        for slot, values, errors in zip(found.slots, found.values, stderrs.reshape(-1, 3), strict=True)
    }
    return {
        "chi_square": _rounded(found.chi_square),
        "degrees_of_freedom": found.degrees_of_freedom,
        "relative_to_slot": found.relative_to_slot,
        "dark": found.dark_w and {"power_w": _rounded(found.dark_w[0]), "stderr_w": _rounded(found.dark_w[1])},
        "slots": slots,
        "correlation": tuple(tuple(row) for row in correlation.round(_CORRELATION_DECIMALS).tolist()),
    }


def _pair(name: str, value: float, stderr: float) -> tuple[tuple[str, float], tuple[str, float]]:
    unit = "_deg" if name == "angle" else ""
    return (f"{name}{unit}", value), (f"{name}_stderr{unit}", stderr)


def _rounded(number: float) -> float:
    return float(f"{number:.{_DIGITS}g}")
