"""`goniometer export RUN --event-model`: a stored run for Bluesky's data tools."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path

from acquisition import journal
from acquisition.event_model import Document, RunEnd, documents, line, write_documents
from goniometer.errors import JournalError
from goniometer.run_folder import as_far_as_measured


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
    run = as_far_as_measured(folder)
    return documents(
        name=run.folder.resolve().name,
        begun_unix_s=_begun_unix_s(run.folder.resolve()),
        recipe=run.recipe,
        readings=run.readings,
        points=run.points,
        end=_end(run.about),
        provenance=run.about,
    )


def _end(about: Mapping[str, str]) -> RunEnd:
    """How a run ended, as its journal says."""
    if "ended" in about:
        return RunEnd("success", about["ended"])
    return RunEnd("abort", about.get(journal.STOPPED, "the program was killed, or the power failed"))


def _begun_unix_s(folder: Path) -> float:
    try:
        return datetime.strptime(folder.name[:19], "%Y-%m-%dT%H-%M-%S").timestamp()
    except ValueError as error:
        raise JournalError(
            f"{folder} does not say when its run began: the name of a run's folder begins with the time, as in "
            "2026-01-31T12-00-00-iron. Nothing was written. Give the folder its name back."
        ) from error
