"""Writes what a person looks at beside a run's journal: tables, the NeXus file, the fit and its pictures."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from acquisition.events import MapsMade
from acquisition.mueller_csv import write_mueller_csv
from acquisition.nexus import write_nexus
from acquisition.readings import MuellerPoint
from acquisition.stokes_csv import write_stokes_csv
from acquisition.whole_file import written_whole
from goniometer.fitted_curve import fitted_curve
from goniometer.fitting.as_json import fit_json
from goniometer.imaging.map_results import MapResults
from goniometer.planning import noise
from goniometer.report import draw_report
from goniometer.run_folder import StoredRun, fitted_family
from goniometer.scan_planes import scan_planes
from goniometer.spectrum import spectrum_json
from goniometer.spectrum_picture import draw_spectrum

_MOST_PLANES = 100
"""Planes that have colours and curves of their own; a picture of scattered directions shows points alone."""


@dataclass(frozen=True)
class Written:
    """The files that were written, and what was made of the pictures where a recipe asks for maps."""

    paths: tuple[Path, ...]
    maps: MapsMade | None = None


def write_results(run: StoredRun) -> Written:
    """Write what a person looks at beside the journal: Stokes points, fit, report and NeXus file; maps come last."""
    csv, nexus, fit_json_path, report = (
        run.folder / name for name in ("stokes.csv", "scan.nxs", "fit.json", "report.png")
    )
    write_stokes_csv(csv, run.points)
    with written_whole(fit_json_path) as part:
        part.write_text(_fit_json(run), encoding="utf-8")
    written = [csv, fit_json_path, report, *_draw_all(report, run)]
    if matrices := [point for point in run.points if isinstance(point, MuellerPoint)]:
        written.append(run.folder / "mueller.csv")
        write_mueller_csv(written[-1], matrices)
    maps = None if run.recipe.imaging is None else MapResults(run)
    write_nexus(
        nexus,
        title=run.recipe.recipe,
        readings=run.readings,
        points=run.points,
        fit=run.fit,
        noise=noise(run.rig, run.recipe.wavelengths_nm()[0]),
        provenance=run.about,
        more=() if maps is None else (maps.write,),
    )
    written.append(nexus)
    return Written(tuple(written)) if maps is None else Written((*written, *maps.written), maps.summary())


def _draw_all(report: Path, run: StoredRun) -> list[Path]:
    """Draw the report; of several wavelengths the spectrum, and a page each, which are returned."""
    if not run.spectrum:
        draw(report, run)
        return []
    draw_spectrum(report, run.spectrum)
    pages = [run.folder / f"report_{one.recipe.one_wavelength_nm:g}nm.png" for one in run.spectrum]
    for page, one in zip(pages, run.spectrum, strict=True):
        draw(page, one)
    return pages


def draw(path: Path, run: StoredRun) -> None:
    """Draw the report of a run; on a page that is not the only one its wavelength stands beside the title."""
    tolerances_deg = {role: axis.tolerance_deg for role, axis in run.rig.axes().items()}
    planes, curves = scan_planes(run.points, tolerances_deg), []
    if len(planes) > _MOST_PLANES:
        planes = ()
    if run.fit is not None:
        for plane in planes:
            points = [run.points[row] for row in plane.rows.tolist()]
            curves.append(fitted_curve(points, fitted_family(run), run.fit))
    title, fit, truth = run.recipe.recipe, run.fit, run.truth
    if path.name != "report.png":
        title += f", {run.recipe.one_wavelength_nm:g} nm"
    draw_report(path, title=title, points=run.points, fit=fit, curves=curves, truth=truth, planes=planes)


def _fit_json(run: StoredRun) -> str:
    if run.spectrum:
        return spectrum_json(run.spectrum)
    if run.fit is None:
        return json.dumps({"parameters": {}, "refusal": run.refusal}, indent=2) + "\n"
    return fit_json(run.fit, run.recipe.fit, run.truth, points=len(run.points), readings=len(run.readings))
