"""What ``goniometer calibrate`` does: measure what is still to be measured, solve all together, store."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from acquisition import journal
from acquisition.calibrated_slots import CalibratedSlot, SlotCalibration
from acquisition.whole_file import written_whole
from goniometer.bench import Speed
from goniometer.calibrating.measure import Tell, measure
from goniometer.calibrating.solve import calibration_text, solved
from goniometer.calibrating.stored_scan import stored_scan
from goniometer.load_files import CalibrationSetup, load_calibration_recipe
from goniometer.output_file import require_output
from goniometer.plus_minus import plus_minus


def calibrate(
    paths: Sequence[Path],
    *,
    rig_path: Path | None = None,
    out: Path,
    speed: Speed | None = None,
    store: Path | None = None,
    ask: Tell,
    tell: Tell,
) -> SlotCalibration:
    """Calibrate an analyzer from recipes, which are run, and from runs that were made of such recipes before.

    Parameters
    ----------
    paths : sequence of Path
        Recipes with a section calibrate, and runs' folders; all are solved together.
    rig_path : Path, optional
        A rig file in place of the recipes'.
    out : Path
        Where the runs' folders are made.
    speed : float or "max", optional
        Time scale of a simulated bench.
    store : Path, optional
        The YAML file to write; without it nothing is stored but the scans.
    ask, tell : callable
        As for `measure`, which says what may be raised, too.

    Raises
    ------
    ConfigurationError
        When a recipe cannot be used, or `store` must not be written; nothing was opened.
    ReductionError
        When the scans do not determine the calibration.
    """
    if store is not None:
        require_output(store, (".yaml", ".yml"), paths)
        store.parent.mkdir(parents=True, exist_ok=True)
    runs = [path.is_dir() or path.name == journal.FILE_NAME for path in paths]
    given: list[Path | CalibrationSetup] = [
        path if is_run else load_calibration_recipe(path, rig_path) for path, is_run in zip(paths, runs, strict=True)
    ]
    scans = []
    for item in given:
        folders = [item] if isinstance(item, Path) else measure(item, out, speed, ask, tell)
        for folder in folders:
            scans.append(stored_scan(folder))
            if not isinstance(item, Path):
                tell(f"  complete; to solve it again: goniometer calibrate {folder} …")
    calibration = solved(scans)
    if store is not None:
        with written_whole(store) as part:
            part.write_text(calibration_text(calibration), encoding="utf-8")
    return calibration


def summary(calibration: SlotCalibration) -> str:
    """A calibration in words and numbers."""
    scatter = (calibration.chi_square / calibration.degrees_of_freedom) ** 0.5
    lines = [
        f"{calibration.calibration}: {len(calibration.scans)} scans, {calibration.wavelength_nm:g} nm, "
        f"bench '{calibration.rig}'",
        f"The readings scatter {scatter:.2f} times as much as the detector's noise"
        + (", and the errors are enlarged by that." if scatter > 1.0 else "."),
        "",
        f"{'slot':>4}  {'rig file':>9}  {'angle':>20}  {'leak':>21}  {'extinction':>14}  transmission against slot "
        f"{calibration.relative_to_slot}",
    ]
    for slot, found in calibration.slots.items():
        lines.append(
            f"{slot:4d}  {found.holds:8g}°  {plus_minus(found.angle_deg, found.angle_stderr_deg) + '°':>20}  "
            f"{plus_minus(found.leak, found.leak_stderr):>21}  {_extinction(found):>14}  "
            f"{plus_minus(found.transmission, found.transmission_stderr)}"
        )
    if calibration.dark is not None:
        lines += ["", f"dark: {plus_minus(calibration.dark.power_w, calibration.dark.stderr_w)} W"]
    return "\n".join(lines)


def _extinction(found: CalibratedSlot) -> str:
    """As polarizers are sold, 1:200; where the leak is lost in its error, the least that it may be."""
    if found.leak > 2.0 * found.leak_stderr:
        return f"1:{1.0 / found.leak:.3g}"
    return f"beyond 1:{1.0 / (max(found.leak, 0.0) + 2.0 * found.leak_stderr):.2g}"
