"""A stored run as documents of Bluesky's event model, which its data tools read: start, descriptors, events, stop."""

from __future__ import annotations

import json
import math
import re
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from acquisition.readings import Reading, StokesPoint
from acquisition.recipe import Recipe
from acquisition.whole_file import written_whole

if TYPE_CHECKING:
    from event_model import DataKey

Document = tuple[str, dict[str, Any]]
"""A document's kind, and the document."""

_UNITS = {
    "deg": "deg",
    "nm": "nm",
    "s": "s",
    "w": "W",
    "stokes": "1/sr",
    "mueller": "1/sr",
    "covariance": "1/sr^2",
}
"""Units by the ends of names, or by whole names."""


@dataclass(frozen=True)
class RunEnd:
    """How a run ended: `exit_status` as the event model has it, and why."""

    exit_status: Literal["success", "abort", "fail"]
    reason: str = ""


def documents(
    *,
    name: str,
    begun_unix_s: float,
    recipe: Recipe,
    readings: Sequence[Reading],
    points: Sequence[StokesPoint],
    end: RunEnd,
    provenance: Mapping[str, str],
) -> Iterator[Document]:
    """The documents of a run; of the same run always the same ones, so that nobody counts it twice.

    The readings are the events of the stream ``primary``; the points, if there are any, those of ``stokes``.

    Parameters
    ----------
    name : str
        Of the run's folder.
    begun_unix_s : float
        When the bench's clock was at zero, in seconds since 1970.
    recipe : Recipe
        What was to be measured.
    readings : sequence of Reading
        The raw readings, in the order they were taken.
    points : sequence of StokesPoint
        What they reduce to.
    end : RunEnd
        How the run ended.
    provenance : mapping of str to str
        Texts of recipe, rig and scene, and versions.
    """
    provenance = {re.sub(r"\W", "_", key): text for key, text in provenance.items()}  # no dots or slashes in keys
    of_run = _Uids(f"{name} {sha256(json.dumps(provenance, sort_keys=True).encode()).hexdigest()}")
    read_unix_s = [begun_unix_s + reading.time_s for reading in readings]
    point_unix_s = {reading.point: unix_s for reading, unix_s in zip(readings, read_unix_s, strict=True)}
    streams = [
        _Stream("primary", "goniometer: reading", "power_w", read_unix_s, [_row(reading) for reading in readings]),
        _Stream(
            "stokes",
            "goniometer: reduced readings",
            "dolp",
            [point_unix_s[point.point] for point in points],
            [_row(point) for point in points],
        ),
    ]
    streams = [stream for stream in streams if stream.rows]
    yield (
        "start",
        {
            "uid": of_run.uid("start"),
            "time": begun_unix_s,
            "plan_name": "goniometer run",
            "run": name,
            "sample": {"name": recipe.recipe},
            "recipe": recipe.model_dump(mode="json"),
            "hints": {"dimensions": _dimensions(recipe)},
            "provenance": provenance,
        },
    )
    for stream in streams:
        yield from _stream(of_run, stream)
    yield (
        "stop",
        {
            "uid": of_run.uid("stop"),
            "run_start": of_run.uid("start"),
            "time": read_unix_s[-1] if readings else begun_unix_s,
            "exit_status": end.exit_status,
            "reason": end.reason,
            "num_events": {stream.name: len(stream.rows) for stream in streams},
        },
    )


def _dimensions(recipe: Recipe) -> list[list[Any]]:
    """Along what the readings lie: an angle each that a product varies, or all of them for a list of points."""
    if recipe.has_points:
        out_of_plane = ["exit_azimuth_deg"] if recipe.directions_deg()[:, 3].any() else []
        return [*_wavelengths(recipe), [["incidence_deg", "exit_deg", "azimuth_deg", *out_of_plane], "primary"]]
    varying = {
        "incidence_deg": len(recipe.incidences_deg()) > 1,
        "azimuth_deg": len(recipe.azimuths_deg()) > 1,
        "exit_azimuth_deg": len(recipe.exit_azimuths_deg()) > 1,
    }
    angles = (*(name for name in varying if varying[name]), "exit_deg")
    return [*_wavelengths(recipe), *([[name], "primary"] for name in angles)]


def _wavelengths(recipe: Recipe) -> list[list[Any]]:
    return [[["wavelength_nm"], "primary"]] if len(recipe.wavelengths_nm()) > 1 else []


def write_documents(path: Path, of_run: Iterable[Document]) -> None:
    """Write documents as JSON lines, each ``[kind, document]``, as suitcase-jsonl does and databroker reads.

    Raises
    ------
    JournalError
        When the file cannot be written.
    """
    with written_whole(path) as part, part.open("w", encoding="utf-8") as file:
        file.writelines(line(document) for document in of_run)


def line(document: Document) -> str:
    """A document as a line of JSON."""
    return json.dumps(document, allow_nan=False) + "\n"


def data_key(value: Any, source: str, units: str | None) -> DataKey:
    """Describe a value that events hold; `units` is None for one that has none."""
    shape: list[int | None] = list(np.shape(value))
    if shape:
        dtype: Literal["string", "number", "array", "integer"] = "array"
    elif isinstance(value, str):
        dtype = "string"
    else:
        dtype = "integer" if isinstance(value, int) else "number"
    key: DataKey = {"source": source, "dtype": dtype, "shape": shape}
    if units is not None:
        key["units"] = units
    return key


@dataclass(frozen=True)
class _Stream:
    """Rows of one kind, with their times; `hint` names the column that is worth a plot."""

    name: str
    source: str
    hint: str
    unix_s: list[float]
    rows: list[dict[str, Any]]


class _Uids:
    """Names that are unique to a run, and the same each time."""

    def __init__(self, run: str) -> None:
        self._run = uuid.uuid5(uuid.NAMESPACE_OID, f"goniometer {run}")

    def uid(self, what: str) -> str:
        return str(uuid.uuid5(self._run, what))


def _stream(of_run: _Uids, stream: _Stream) -> Iterator[Document]:
    """The descriptor of a stream and its events."""
    names = [name for name in stream.rows[0] if any(row[name] is not None for row in stream.rows)]
    keys = {
        name: data_key(
            next(row[name] for row in stream.rows if row[name] is not None),
            stream.source,
            _UNITS.get(name, _UNITS.get(name.rpartition("_")[2])),
        )
        for name in names
    }
    descriptor = of_run.uid(f"descriptor {stream.name}")
    yield (
        "descriptor",
        {
            "uid": descriptor,
            "run_start": of_run.uid("start"),
            "time": stream.unix_s[0],
            "name": stream.name,
            "data_keys": keys,
            "object_keys": {"goniometer": names},
            "hints": {"goniometer": {"fields": [stream.hint]}},
            "configuration": {},
        },
    )
    for number, (unix_s, row) in enumerate(zip(stream.unix_s, stream.rows, strict=True), start=1):
        yield (
            "event",
            {
                "uid": of_run.uid(f"event {stream.name} {number}"),
                "descriptor": descriptor,
                "seq_num": number,
                "time": unix_s,
                "data": {name: row[name] for name in names},
                "timestamps": dict.fromkeys(names, unix_s),
                "filled": {},
            },
        )


def _row(of: Reading | StokesPoint) -> dict[str, Any]:
    return {field.name: _plain(getattr(of, field.name)) for field in fields(of)}


def _plain(value: Any) -> Any:
    """A value as JSON has it, which knows no NaN."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
