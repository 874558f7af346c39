"""A calibration's scan, read back from its journal."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import yaml

from acquisition import journal
from acquisition.calibration_problem import CalibrationScan
from acquisition.calibration_recipe import CalibrationRecipe, calibration_steps
from acquisition.journal import Journal
from goniometer.calibrating.measure import SETTING
from goniometer.errors import ReductionError
from goniometer.planning import slots, timing
from goniometer.rig_file import Rig


@dataclass(frozen=True)
class StoredScan:
    """A scan with what its journal remembers."""

    scan: CalibrationScan
    recipe: CalibrationRecipe
    rig: Rig
    started: datetime
    recipe_sha256: str


def stored_scan(folder: Path) -> StoredScan:
    """Read a scan.

    Raises
    ------
    JournalError
        When there is no readable journal.
    ReductionError
        When it is the run of an ordinary recipe, or was cut short.
    """
    folder = folder.parent if folder.name == journal.FILE_NAME else folder
    with Journal.open(folder / journal.FILE_NAME) as stored:
        readings, about = stored.readings(), stored.about()
    content = yaml.safe_load(about["recipe"])
    if "calibrate" not in content:
        raise ReductionError(
            f"{folder} is the run of a recipe without a section calibrate: what its light is is not known. Name a scan "
            "that goniometer calibrate has made."
        )
    recipe, rig = CalibrationRecipe.model_validate(content), Rig.model_validate(yaml.safe_load(about["rig"]))
    planned = sum(step.readings for step in calibration_steps(recipe, slots(rig, recipe.wavelength_nm), timing(rig)))
    if len(readings) < planned:
        raise ReductionError(
            f"{folder} was cut short: it holds {len(readings)} of {planned} readings. Measure it again."
        )
    setting_deg = float(about[SETTING]) if SETTING in about else None
    scan = CalibrationScan(folder.resolve().name, recipe.calibrate, setting_deg, readings)
    return StoredScan(scan, recipe, rig, datetime.fromisoformat(about["started"]), about["recipe_sha256"])
