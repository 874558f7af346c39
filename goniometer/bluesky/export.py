"""`goniometer export RUN --event-model`: a stored run for Bluesky's data tools."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

from acquisition import journal
from acquisition.event_model import Document, RunEnd, documents, line, write_documents
from acquisition.journal import Journal
from acquisition.readings import Reading, StokesPoint
from acquisition.recipe import Recipe
from acquisition.wavelengths import by_wavelength
from goniometer.errors import JournalError
from goniometer.planning import plan, reduction
from goniometer.rig_file import Rig
from goniometer.run_folder import remembered


def export_event_model(folder: Path, out: Path | None) -> None:
    """Write the documents of a run as JSON lines into a file, or to standard output without one.

    Parameters
    ----------
    folder : Path
        The run's folder, of a finished scan or of one that was cut short, or the journal in it.
    out : Path or None
        The file; replaced as a whole if it exists.

    Raises
    ------
    JournalError
        When there is no readable journal, the folder's name does not say when the run began, or the file cannot be
        written.
    ReductionError
        When the readings cannot be reduced.
    """
    of_run = run_documents(folder)
    if out is None:
        sys.stdout.writelines(line(document) for document in of_run)
    else:
        write_documents(out, of_run)


def run_documents(folder: Path) -> Iterator[Document]:
    """The documents of a stored run; see `export_event_model`."""
    folder = folder.parent if folder.name == journal.FILE_NAME else folder
    with Journal.open(folder / journal.FILE_NAME) as stored:
        readings, about = stored.readings(), stored.about()
    recipe, rig, calibration = remembered(folder, about)
    points = tuple(
        point
        for wavelength_nm, of_one in by_wavelength(recipe, readings).items()
        for point in reduction(recipe.at_wavelength(wavelength_nm), rig, calibration).scan(of_one)
    )
    return documents(
        name=folder.resolve().name,
        begun_unix_s=_begun_unix_s(folder.resolve()),
        recipe=recipe,
        readings=readings,
        points=points,
        end=_end(recipe, rig, readings, points),
        provenance=about,
    )


def _end(recipe: Recipe, rig: Rig, readings: Sequence[Reading], points: Sequence[StokesPoint]) -> RunEnd:
    """How a run ended, as far as its readings tell."""
    if not recipe.is_steered:
        planned = sum(step.readings for step in plan(recipe, rig))
        if len(readings) < planned:
            return RunEnd("abort", f"{len(readings)} of {planned} readings were taken")
    elif recipe.averaging is not None:
        planned = len({step.point for step in plan(recipe, rig)})
        if len(points) < planned:
            return RunEnd("abort", f"{len(points)} of {planned} directions were finished")
    elif not readings or len(points) < len({reading.point for reading in readings}):
        return RunEnd("abort", f"the last direction was not finished; {len(readings)} readings were taken")
    return RunEnd("success")


def _begun_unix_s(folder: Path) -> float:
    try:
        return datetime.strptime(folder.name[:19], "%Y-%m-%dT%H-%M-%S").timestamp()
    except ValueError as error:
        raise JournalError(
            f"{folder} does not say when its run began: the name of a run's folder begins with the time, as in "
            "2026-01-31T12-00-00-iron. Nothing was written. Give the folder its name back."
        ) from error
