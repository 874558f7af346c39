"""What a fit is given: a run, a NeXus file or a table of measured values, and the surfaces to choose from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError

from acquisition.fit_choice import FitChoice
from acquisition.fit_points import dataset, fit_arguments, named_in_degrees, surface_family
from acquisition.journal import FILE_NAME
from acquisition.measured_csv import read_measured_csv
from acquisition.measured_nexus import read_measured_nexus
from acquisition.recipe import Recipe
from goniometer.errors import ConfigurationError, FitError, JournalError
from goniometer.faults import model_faults
from goniometer.fitting.doubts import doubts
from goniometer.load_files import load_rig
from goniometer.recipe_includes import whole_recipe
from goniometer.rig_file import Rig
from goniometer.run_folder import measured, scene_truth
from goniometer.shared_errors import refits
from goniometer.yaml_file import read_yaml
from model.fit import Dataset, FitResult, fit
from model.fit.ellipsometric import Ellipsometric
from model.fit.observable import Elements
from model.fit.quantities import SURFACE

NEXUS_SUFFIXES = (".nxs", ".h5", ".hdf5")
TABLE_SUFFIXES = (".csv", ".tsv", ".txt")

_SMOOTH = 0.01
"""Roughness of a sample that ellipsometry takes for smooth; in the mirror direction nothing depends on it."""


_SHARED = (
    "All directions share the errors of the analyzer's calibration and of the arms' zeros. This fit leaves that out; "
    "its standard errors may be too small; those of goniometer fit RUN, as the run's own recipe says, are not"
)


@dataclass(frozen=True)
class FitInput:
    """Measured data, and what is known of how they were measured.

    Attributes
    ----------
    path : Path
        The run's folder, or the file.
    data : Dataset
        The values; their name is that of the folder or file, without the path.
    choice : FitChoice or None
        The fit section of the recipe that a run remembers; None for a bare file.
    acceptance_sr : float or None
        The acceptance of the detector that a run remembers; None for a bare file.
    truth : mapping of str to float
        The parameters of the sample that a run simulated; empty for a real one and for a bare file.
    notes : tuple of str
        What looks wrong in a table, or in the light of a run, though it can be fitted.
    """

    path: Path
    data: Dataset
    choice: FitChoice | None
    acceptance_sr: float | None
    truth: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


_SEVERAL = (
    "{path} was measured at several wavelengths, and a surface has one refractive index in a fit. Nothing was fitted. "
    "Fit the run as its recipe says, goniometer fit RUN without options, or a table with the rows of one wavelength."
)


def read_input(path: Path) -> FitInput:
    """Read measured data, whatever they are stored in; reduces the readings of a run, and fits nothing.

    Parameters
    ----------
    path : Path
        A run's folder or its journal; a NeXus file written by a run; a table of text (docs/fit.md names its columns).

    Raises
    ------
    JournalError
        If there is no such file, or it cannot be read.
    ReductionError
        If the readings of a run cannot be reduced.
    FitError
        If the file is of another kind, or what it holds cannot be fitted; names file, line and column.
    """
    path = Path(path)
    if path.is_dir() or path.name == FILE_NAME:
        run = measured(path)
        if run.at_each:
            raise FitError(_SEVERAL.format(path=path))
        data = dataset(run.points, run.folder.name)
        truth = scene_truth(run.about["scene"], run.recipe.one_wavelength_nm)
        notes = (*run.doubts, _SHARED) if any(refits(run)) else run.doubts
        return FitInput(run.folder, data, run.recipe.fit, run.rig.calibration.acceptance_sr, truth, notes)
    if not path.exists():
        raise JournalError(f"{path} does not exist. Name a run's folder, a NeXus file (.nxs) or a table (.csv).")
    if path.suffix.lower() in NEXUS_SUFFIXES:
        data, about = read_measured_nexus(path)
        return _remembered(FitInput(path, data, None, None), about)
    if path.suffix.lower() in TABLE_SUFFIXES:
        data = read_measured_csv(path)
        return FitInput(path, data, None, None, notes=doubts(data))
    raise FitError(
        f"{path} is not something that can be fitted. Nothing was read. Name a run's folder, a NeXus file "
        f"({', '.join(NEXUS_SUFFIXES)}) or a table ({', '.join(TABLE_SUFFIXES)})."
    )


def read(path: str | Path) -> Dataset:
    """Measured data out of a run's folder, a NeXus file or a table, ready for `goniometer.fit`; see `read_input`."""
    return read_input(Path(path)).data


def _remembered(given: FitInput, about: Mapping[str, str]) -> FitInput:
    """What the texts in a NeXus file add to its data."""
    try:
        wavelength_nm = None
        if about.get("recipe"):
            recipe = Recipe.model_validate(yaml.safe_load(about["recipe"]))
            given, wavelength_nm = replace(given, choice=recipe.fit), recipe.wavelengths_nm()[0]
        if about.get("rig"):
            rig = Rig.model_validate(yaml.safe_load(about["rig"]))
            given = replace(given, acceptance_sr=rig.calibration.acceptance_sr)
        return replace(given, truth=scene_truth(about.get("scene", ""), wavelength_nm))
    except (ValidationError, yaml.YAMLError) as error:
        raise FitError(
            f"{given.path}: the recipe, rig or scene that the file remembers cannot be used: {error}. Nothing was "
            "fitted. Fit the run's folder or its stokes.csv instead."
        ) from error


class _FitAlone(BaseModel):
    """A file with a fit section, and perhaps a rig."""

    fit: FitChoice


def choice_from(path: Path) -> FitChoice:
    """The fit section of a recipe, or of a file that holds nothing else but perhaps a rig.

    Parameters
    ----------
    path : Path
        A YAML file with the key `fit`.

    Raises
    ------
    ConfigurationError
        Lists every fault with file and line, of a recipe those of the whole.
    """
    file = whole_recipe(read_yaml(path))
    faults = list(file.faults)
    if file.data is not None:
        try:
            model = _FitAlone if file.data.keys() <= {"fit", "rig"} or "fit" not in file.data else Recipe
            choice = model.model_validate(file.data).fit
        except ValidationError as error:
            faults += model_faults(error, file, "recipe")
    if faults:
        raise ConfigurationError([str(fault) for fault in sorted(set(faults), key=lambda fault: fault.line or 0)])
    return choice


def with_recipe(given: FitInput, path: Path) -> FitInput:
    """What was read, to be fitted as another recipe says; for a bare file, with the acceptance of that recipe's rig.

    Parameters
    ----------
    given : FitInput
        What was read.
    path : Path
        A recipe, or a file that holds its fit section alone.

    Raises
    ------
    ConfigurationError
        Lists every fault of the fit section, or of the rig.
    """
    given = replace(given, choice=choice_from(path))
    rig = (whole_recipe(read_yaml(path)).data or {}).get("rig")
    if given.acceptance_sr is None and isinstance(rig, str):
        return replace(given, acceptance_sr=load_rig(path.parent / rig).calibration.acceptance_sr)
    return given


def overridden(choice: FitChoice, **changes: Any) -> FitChoice:
    """A fit section with some of its keys changed.

    Raises
    ------
    ConfigurationError
        If the result makes no sense.
    """
    try:
        return FitChoice.model_validate({**choice.model_dump(), **changes})
    except ValidationError as error:
        words = " and ".join(f"{key} {value}" for key, value in changes.items())
        faults = [detail["msg"] for detail in error.errors(include_url=False)]
        raise ConfigurationError([f"The fit section does not go with {words}: {fault}" for fault in faults]) from error


def fit_input(given: FitInput, choice: FitChoice | None = None, *, seed: int = 0) -> FitResult:
    """Fit what was read.

    Parameters
    ----------
    given : FitInput
        The data.
    choice : FitChoice, optional
        What to fit, in place of the input's own; where there is neither, it is what `usual_choice` says.
    seed : int
        Seed of the search.

    Raises
    ------
    FitError
        If the data cannot determine what is asked for.
    """
    choice = choice or given.choice or usual_choice(given.data)
    refuse_unanswerable(given, choice)
    with named_in_degrees():
        return fit(given.data, surface_family(choice, given.acceptance_sr), **fit_arguments(choice), seed=seed)


def refuse_unanswerable(given: FitInput, choice: FitChoice) -> None:
    """Refuse a fit whose question this kind of data cannot answer, whatever the values.

    Raises
    ------
    FitError
        Names the file and what to change.
    """
    data, faults = given.data, []
    if choice.robust and data.covariance is None:
        faults.append("robust: without errors no row is far from the fit; add columns of errors, or leave robust out")
    if not data.observable.has_scale:
        faults += [f"{'.'.join(map(str, place))}: {what}" for place, what in choice.ratio_faults(data.name)]
    elements = data.observable.picked if isinstance(data.observable, Elements) else ()
    is_unpolarized = len(elements) > 1 and data.values[:, 0].any() and not data.values[:, 1:].any()
    if is_unpolarized and any(name.rpartition(".")[2] in ("n", "k") for name in choice.free):
        faults.append("free: without any polarization the data know nothing of n and k; fix them, or measure again")
    if faults:
        raise FitError("\n".join([*(f"{given.path}: {fault}" for fault in faults), "Nothing was fitted."]))


def usual_choice(data: Dataset) -> FitChoice:
    """What is fitted where nobody says otherwise: three lobes with all free; of ellipsometry, n and k of one facet."""
    index = {name: SURFACE[name].usual for name in ("n", "k")}
    if isinstance(data.observable, Ellipsometric):
        return FitChoice.model_validate({"lobes": ["specular"], "free": index, "fixed": {"sigma": _SMOOTH}})
    return FitChoice.model_validate(
        {"lobes": ["specular", "diffuse", "directional"], "free": {"sigma": SURFACE["sigma"].usual, **index}}
    )
