"""What ``goniometer fit`` does with one input: read, fit, and say what was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acquisition.fit_choice import FitChoice
from acquisition.fit_points import dataset
from acquisition.journal import FILE_NAME
from acquisition.whole_file import written_whole
from goniometer.errors import FitError, GoniometerError
from goniometer.fitting.as_json import fit_json
from goniometer.fitting.input import fit_input, overridden, read_input, usual_choice, with_recipe
from goniometer.fitting.intervals import Intervals, intervals
from goniometer.fitting.summary import fit_summary
from goniometer.run_folder import stored_run
from goniometer.run_results import write_results
from goniometer.spectrum import FittedSpectrum
from model.fit import Dataset, FitResult


@dataclass(frozen=True)
class Fitted:
    """One fit with all that is said about it; `notes` are for the person at the terminal."""

    path: Path
    data: Dataset
    choice: FitChoice
    truth: Mapping[str, float]
    result: FitResult
    intervals: Intervals = field(default_factory=Intervals)
    notes: tuple[str, ...] = ()

    def summary(self) -> str:
        """The fit in words and numbers."""
        return "\n".join([fit_summary(self.result, self.truth, self.data), *self.intervals.lines()])

    def json_text(self) -> str:
        """The fit as JSON."""
        more: dict[str, Any] = {"intervals": self.intervals} if self.intervals != Intervals() else {}
        if self.notes:
            more["notes"] = self.notes
        if self.data.lines is not None:
            more["outlier_lines"] = [self.data.lines[outlier.row] for outlier in self.result.outliers]
        return fit_json(self.result, self.choice, self.truth, input=str(self.path), rows=len(self.data), **more)

    def write_json(self, path: Path) -> None:
        """Write the fit as JSON into a file, which is replaced as a whole."""
        with written_whole(path) as part:
            part.write_text(self.json_text(), encoding="utf-8")


def fit_one(
    path: Path,
    recipe: Path | None = None,
    changes: Mapping[str, Any] | None = None,
    *,
    profiled: Sequence[str] = (),
    bootstrapped: int = 0,
) -> Fitted | FittedSpectrum:
    """Fit a run, a NeXus file or a table.

    A run that is fitted as its own recipe says gets its results written anew; otherwise nothing is written.

    Parameters
    ----------
    path : Path
        What to fit.
    recipe : Path, optional
        A file whose fit section counts in place of the input's own.
    changes : mapping of str to Any, optional
        Keys of the fit section that are changed.
    profiled : sequence of str
        Parameters whose profile likelihood is wanted.
    bootstrapped : int
        How many fits to data made anew are wanted.

    Raises
    ------
    GoniometerError
        If the input or the recipe cannot be used, or the data cannot determine what is asked for.
    """
    if recipe is None and not changes and (path.is_dir() or path.name == FILE_NAME):
        return _fit_again(path, profiled, bootstrapped)
    given = read_input(path)
    notes = list(given.notes)
    if recipe is not None:
        given = with_recipe(given, recipe)
    choice = given.choice
    if choice is None:
        choice = usual_choice(given.data)
        bounds = ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in choice.free.items())
        notes.append(
            f"{path} does not say what to fit. Fitted are the lobes {', '.join(choice.lobes)}, with {bounds} and free "
            "weights. Say otherwise with --recipe."
        )
    choice = overridden(choice, **changes or {})
    result = fit_input(given, choice)
    found = intervals(given.data, choice, given.acceptance_sr, result, profiled, bootstrapped)
    return Fitted(path, given.data, choice, given.truth, result, found, tuple(notes))


def _fit_again(path: Path, profiled: Sequence[str], bootstrapped: int) -> Fitted | FittedSpectrum:
    stored = stored_run(path)
    if stored.spectrum and (profiled or bootstrapped):
        raise FitError(f"{stored.folder} has a fit for each wavelength. Leave --profile and --bootstrap out.")
    interruptions = stored.about.get("interruptions", "").splitlines()
    written = write_results(stored)
    of_maps = () if written.maps is None else str(written.maps).splitlines()
    notes = (*stored.doubts, *interruptions, *of_maps, *(f"wrote {path}" for path in written.paths))
    if stored.spectrum:
        return FittedSpectrum(stored, notes)
    if stored.fit is None:
        error = GoniometerError(f"{stored.folder}: {len(stored.points)} points could not be fitted: {stored.refusal}")
        for note in notes:
            error.add_note(note)
        raise error
    data, choice = dataset(stored.points), stored.recipe.fit
    acceptance_sr = stored.rig.calibration.acceptance_sr
    found = intervals(data, choice, acceptance_sr, stored.fit, profiled, bootstrapped)
    return Fitted(stored.folder, data, choice, stored.truth, stored.fit, found, notes)
