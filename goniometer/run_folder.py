"""A run's folder: the journal of its readings and everything made from them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

import yaml

from acquisition import journal
from acquisition.calibrated_slots import SlotCalibration
from acquisition.decisions import without_decisions
from acquisition.doubts import skipped
from acquisition.fit_points import dataset, fit_arguments, named_in_degrees, surface_family
from acquisition.journal import Journal
from acquisition.orders import skipped_points
from acquisition.readings import Reading, StokesPoint
from acquisition.recipe import Recipe
from acquisition.suspend import suspensions
from acquisition.wavelengths import by_wavelength
from goniometer.errors import FitError, JournalError, ReductionError
from goniometer.planning import averaged, reduction
from goniometer.rig_file import Rig
from goniometer.shared_errors import refits, with_shared_errors
from model.fit import FitResult, SurfaceFamily, fit
from sim_devices.scene import Scene

_LONGEST_NAME = 60
"""Of a recipe's name as much goes into the folder's; some systems allow no more than 143 characters."""


@dataclass(frozen=True)
class MeasuredRun:
    """What a run measured: its readings, and the Stokes points they reduce to.

    `about` holds the texts and versions that the journal remembers; `doubts` are what a person should know of the light
    before believing in the points, such as directions that are left out because nobody knows how bright the lamp was.
    `calibration` is what the readings were reduced with, None for ideal polarizers. `at_each` are the same by
    wavelength, a run of its own for each that has points, where the recipe lists several; else there are none.
    """

    folder: Path
    recipe: Recipe
    rig: Rig
    readings: tuple[Reading, ...]
    points: tuple[StokesPoint, ...]
    about: dict[str, str]
    doubts: tuple[str, ...]
    calibration: SlotCalibration | None
    at_each: tuple[MeasuredRun, ...] = ()


@dataclass(frozen=True)
class StoredRun(MeasuredRun):
    """A stored run, with the fit of its points.

    `fit` is None, and `refusal` says why, when the points do not determine the parameters. `truth` is empty unless
    the sample was simulated. Several wavelengths have no fit together: `spectrum` holds one stored run for each, in
    the order of the recipe.
    """

    fit: FitResult | None = None
    refusal: str = ""
    truth: dict[str, float] = field(default_factory=dict)
    spectrum: tuple[StoredRun, ...] = ()


def new_run_folder(out: Path, recipe_name: str) -> Path:
    """Make a folder for a new run, named by time and recipe.

    Raises
    ------
    JournalError
        When it cannot be made.
    """
    name = re.sub(r"[^a-z0-9]+", "-", recipe_name.lower()).strip("-")[:_LONGEST_NAME] or "scan"
    stem = f"{datetime.now():%Y-%m-%dT%H-%M-%S}-{name}"
    for suffix in ("", *(f"-{number}" for number in range(2, 1000))):
        folder = out / f"{stem}{suffix}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise JournalError(
                f"The run's folder {folder} cannot be made: {error.strerror}. No device was moved. "
                "Choose another with --out."
            ) from error
        return folder
    raise JournalError(
        f"{out} holds a thousand runs named {stem}. No device was moved. Choose another folder with --out."
    )


def measured(folder: str | Path) -> MeasuredRun:
    """Read a run back from its journal and reduce its readings.

    Parameters
    ----------
    folder : str or Path
        The run's folder, of a finished scan or of one that was cut short, or the journal in it.

    Raises
    ------
    JournalError
        When there is no readable journal.
    ReductionError
        When the readings cannot be reduced, or no direction was finished.
    """
    run = as_far_as_measured(folder)
    if not run.points:
        raise ReductionError(
            f"{run.folder} holds {len(run.readings)} readings and not one finished direction: there is nothing to "
            "reduce."
        )
    return run


def as_far_as_measured(folder: str | Path) -> MeasuredRun:
    """Read a run back as `measured` does, also one that has no finished direction and so no points."""
    folder = Path(folder)
    if folder.name == journal.FILE_NAME:
        folder = folder.parent
    with Journal.open(folder / journal.FILE_NAME) as stored:
        readings, about = stored.readings(), without_decisions(stored.about())
        interruptions = stored.interruptions()
        damage = (
            f"{stored.path} is damaged ({stored.damage}): {len(readings)} readings can be read" if stored.damage else ""
        )
    if interruptions:
        about["interruptions"] = "\n".join(map(str, interruptions))
    if damage and not {"recipe", "rig", "scene"} <= about.keys():
        raise JournalError(f"{damage}, but not what they are of. Look for a copy of the journal.")
    recipe, rig, calibration = remembered(folder, about)
    runs = [
        _reduced(folder, recipe.at_wavelength(wavelength_nm), rig, of_one, about, calibration)
        for wavelength_nm, of_one in by_wavelength(recipe, readings).items()
    ]
    points = tuple(point for run in runs for point in run.points)
    found = tuple(filter(None, [damage, skipped(skipped_points(about))]))
    if len(recipe.wavelengths_nm()) == 1:
        return replace(runs[0], doubts=(*found, *runs[0].doubts))
    doubts = tuple(f"at {run.recipe.one_wavelength_nm:g} nm: {doubt}" for run in runs for doubt in run.doubts)
    at_each = tuple(run for run in runs if run.points)
    return MeasuredRun(folder, recipe, rig, readings, points, about, (*found, *doubts), calibration, at_each)


def _reduced(
    folder: Path,
    recipe: Recipe,
    rig: Rig,
    readings: tuple[Reading, ...],
    about: dict[str, str],
    calibration: SlotCalibration | None,
) -> MeasuredRun:
    """The readings of one wavelength."""
    reduced_by, left_out = reduction(recipe, rig, calibration, suspensions(about)), skipped_points(about)
    used = tuple(reading for reading in readings if reading.kind != "signal" or reading.point not in left_out)
    points = reduced_by.scan(used)
    doubts = reduced_by.doubts(used, points)
    if (reached := averaged(recipe, rig)) is not None:
        doubts += reached.doubts(used, points)
    return MeasuredRun(folder, recipe, rig, readings, points, about, doubts, calibration)


def remembered(folder: Path, about: Mapping[str, str]) -> tuple[Recipe, Rig, SlotCalibration | None]:
    """The recipe, the rig and the calibration of a run, as its journal remembers them.

    Raises
    ------
    ReductionError
        When it is the scan of a calibration.
    """
    content = yaml.safe_load(about["recipe"])
    if "calibrate" in content:
        raise ReductionError(
            f"{folder} is a scan for a calibration, which is solved, not reduced: goniometer calibrate {folder}"
        )
    recipe, rig = Recipe.model_validate(content), Rig.model_validate(yaml.safe_load(about["rig"]))
    calibration = None
    if recipe.calibration is not None:
        calibration = SlotCalibration.model_validate(yaml.safe_load(about["calibration"]))
    return recipe, rig, calibration


def stored_run(folder: str | Path) -> StoredRun:
    """Read a run back from its journal: reduce its readings and fit them, as `goniometer fit` does.

    Parameters
    ----------
    folder : str or Path
        As for `measured`, which says what may go wrong.
    """
    run = measured(folder)
    if not run.at_each:
        return _fitted(run)
    listed = ", ".join(f"{wavelength_nm:g}" for wavelength_nm in run.recipe.wavelengths_nm())
    refusal = f"it was measured at several wavelengths ({listed} nm), and each has a fit of its own"
    return StoredRun(**vars(run), refusal=refusal, spectrum=tuple(_fitted(one) for one in run.at_each))


def _fitted(run: MeasuredRun) -> StoredRun:
    """A run at one wavelength, with the fit of its points."""
    choice, result, refusal = run.recipe.fit, None, ""
    try:
        with named_in_degrees():
            result = fit(dataset(run.points, run.folder.name), fitted_family(run), **fit_arguments(choice))
            result = with_shared_errors(result, refits(run))
    except FitError as error:
        refusal = str(error)
    truth = scene_truth(run.about["scene"], run.recipe.one_wavelength_nm)
    return StoredRun(**vars(run), fit=result, refusal=refusal, truth=truth)


def scene_truth(scene_text: str, wavelength_nm: float | None = None) -> dict[str, float]:
    """The parameters of a simulated sample at a wavelength; none when there is no scene."""
    return Scene.model_validate(yaml.safe_load(scene_text)).truth(wavelength_nm) if scene_text else {}


def fitted_family(run: MeasuredRun) -> SurfaceFamily:
    """The surfaces that a run is fitted by."""
    return surface_family(run.recipe.fit, run.rig.calibration.acceptance_sr)
