"""What a scan at several wavelengths has found: the parameters of each of its fits against the wavelength."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquisition.events import SpectrumFitted
from acquisition.whole_file import written_whole
from goniometer.fitting.as_json import fit_json
from goniometer.fitting.remarks import remarks
from goniometer.fitting.summary import ParameterRow, parameter_rows, quality
from model.fit import FitResult

if TYPE_CHECKING:
    from goniometer.run_folder import StoredRun

_NM = "wavelength"


def spectrum_fitted(run: StoredRun) -> SpectrumFitted:
    """The fits of a run at several wavelengths, as an event."""
    return SpectrumFitted(
        tuple(one.recipe.one_wavelength_nm for one in run.spectrum),
        tuple(one.fit for one in run.spectrum),
        tuple(one.truth for one in run.spectrum),
    )


def spectrum_text(found: SpectrumFitted) -> str:
    """Write the fits for a person to read: a table of the parameters against the wavelength, then how good each fit is.

    Below each value of a simulated sample stands the true one, and by how many standard errors the value is off.
    """
    said = [
        f"{wavelength_nm:g} nm: {remark}"
        for wavelength_nm, result in zip(found.wavelengths_nm, found.results, strict=True)
        for remark in _said(result)
    ]
    return "\n".join([*_table(found), "", *said])


def _said(result: FitResult | None) -> Iterator[str]:
    if result is None:
        yield "could not be fitted."
    else:
        yield quality(result)
        yield from remarks(result)


def _table(found: SpectrumFitted) -> list[str]:
    rows: list[dict[str, str]] = []
    for wavelength_nm, result, truth in zip(found.wavelengths_nm, found.results, found.truths, strict=True):
        of_one = [] if result is None else parameter_rows(result, truth)
        rows.append({_NM: f"{wavelength_nm:g} nm"} | {row.name: _value(row) for row in of_one})
        if any(row.truth for row in of_one):
            rows.append({_NM: "true"} | {row.name: _true(row) for row in of_one})
    columns = list(dict.fromkeys([_NM, *(name for row in rows for name in row)]))
    widths = {name: max(len(name), *(len(row.get(name, "")) for row in rows)) for name in columns}
    lines = [{name: name for name in columns}, *rows]
    return ["   ".join(f"{row.get(name, ''):<{widths[name]}}" for name in columns).rstrip() for row in lines]


def _value(row: ParameterRow) -> str:
    return f"{row.value} ± {row.error}" if row.error else f"{row.value} {row.note}"


def _true(row: ParameterRow) -> str:
    return f"{row.truth} ({row.off})" if row.off else row.truth


def spectrum_json(runs: Sequence[StoredRun]) -> str:
    """Write the fits as JSON: under `wavelengths` what `fit_json` says of each, or why there is no fit."""
    return json.dumps({"wavelengths": [_as_json(run) for run in runs]}, indent=2, ensure_ascii=False) + "\n"


def _as_json(run: StoredRun) -> Mapping[str, Any]:
    wavelength = {"wavelength_nm": run.recipe.one_wavelength_nm}
    if run.fit is None:
        return wavelength | {"parameters": {}, "refusal": run.refusal}
    text = fit_json(run.fit, run.recipe.fit, run.truth, points=len(run.points), readings=len(run.readings))
    return {**wavelength, **json.loads(text)}


class FittedSpectrum:
    """The fits of a stored run at several wavelengths, with all that is said about them.

    Parameters
    ----------
    run : StoredRun
        The run.
    notes : tuple of str
        For the person at the terminal.
    """

    def __init__(self, run: StoredRun, notes: tuple[str, ...]) -> None:
        self._run, self.notes = run, notes

    def summary(self) -> str:
        """The fits in words and numbers."""
        return spectrum_text(spectrum_fitted(self._run))

    def json_text(self) -> str:
        """The fits as JSON."""
        return spectrum_json(self._run.spectrum)

    def write_json(self, path: Path) -> None:
        """Write the fits as JSON into a file, which is replaced as a whole."""
        with written_whole(path) as part:
            part.write_text(self.json_text(), encoding="utf-8")
