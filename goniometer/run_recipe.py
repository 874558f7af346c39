"""Run a recipe from beginning to end: bench, scan, live fit, results."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, suppress
from datetime import datetime
from pathlib import Path

from acquisition import journal
from acquisition.control import ScanControl
from acquisition.events import FitUpdated, Subscriber
from acquisition.journal import Journal
from acquisition.suspend import SuspendWhen
from acquisition.watchdog import LIMIT_S
from goniometer.assembly import connected
from goniometer.attended import Attended
from goniometer.bench import Speed, access
from goniometer.imaging.sensor_files import keep_sensor_files
from goniometer.load_files import Setup, load_recipe
from goniometer.provenance import devices_text, provenance
from goniometer.run_folder import StoredRun, new_run_folder, stored_run
from goniometer.run_lock import sole_writer
from goniometer.run_results import write_results
from goniometer.scanning import scan
from goniometer.signals import Interruption
from goniometer.spectrum import spectrum_fitted
from goniometer.wire_trace import WIRE_LOG, wire_log


def run(
    recipe_path: str | Path,
    *,
    rig_path: str | Path | None = None,
    out: str | Path = "runs",
    speed: Speed | None = None,
    live_fit: bool = True,
    trace: bool = False,
    subscribers: Sequence[Subscriber] = (),
    control: ScanControl | None = None,
    suspend_when: SuspendWhen | None = None,
    watchdog_s: float = LIMIT_S,
) -> StoredRun:
    """Run a recipe, store every reading, fit while it runs, and write the results.

    Parameters
    ----------
    recipe_path : str or Path
        The recipe.
    rig_path : str or Path, optional
        A rig file in place of the recipe's.
    out : str or Path
        Where the run's folder is made.
    speed : float or "max", optional
        Time scale of a simulated bench.
    live_fit : bool
        Whether to fit while the scan runs; the final fit is made in any case, and so are those by which a scan with
        `until` or `adaptive` decides.
    trace : bool
        Whether every byte sent and received is written into `wire.log` in the run's folder.
    subscribers : sequence of callable
        Called with every event of the scan, in the calling thread.
    control : ScanControl, optional
        Pauses the scan, ends it and so on, from any thread.
    suspend_when : callable, optional
        Called with each reading before it is stored. A text that it returns says why the reading is in doubt: the scan
        waits, as the recipe's `suspend` says for how long, and takes the reading again.
    watchdog_s : float
        How long the scan's thread may hang, in real seconds: then the program is ended with exit code 4, and the bench
        stopped by another process.

    Returns
    -------
    StoredRun
        The run, read back from its journal.

    Raises
    ------
    ConfigurationError
        When recipe, rig or scene cannot be used; nothing was opened.
    DeviceError
        When a device fails. The bench is stopped; the readings so far are in the journal.
    ScanInterrupted
        On Ctrl-C, SIGTERM, SIGHUP or `control.abort`; likewise.
    SuspendedTooLongError
        When a reading stays in doubt; likewise.
    """
    setup = load_recipe(Path(recipe_path), Path(rig_path) if rig_path else None)
    with Interruption() as interruption:
        attended = Attended(interruption, control or ScanControl(), suspend_when, watchdog_s)
        folder = _measure(setup, Path(out), speed, live_fit, trace, subscribers, attended)
        return results(folder, subscribers, interruption)


def results(folder: Path, subscribers: Sequence[Subscriber], interruption: Interruption) -> StoredRun:
    """Fit what a scan has measured, tell it, and write it beside the journal."""
    try:
        interruption.check()
        result = stored_run(folder)
        if result.spectrum:
            for subscriber in subscribers:
                subscriber(spectrum_fitted(result))
        if result.fit is not None:
            for subscriber in subscribers:
                subscriber(FitUpdated(len(result.points), result.fit))
        interruption.check()
        made = write_results(result).maps
        if made is not None:
            for subscriber in subscribers:
                subscriber(made)
    except BaseException as error:
        error.add_note(f"All readings are stored. Write the results with: goniometer fit {folder}")
        raise
    return result


def _measure(
    setup: Setup,
    out: Path,
    speed: Speed | None,
    live_fit: bool,
    trace: bool,
    subscribers: Sequence[Subscriber],
    attended: Attended,
) -> Path:
    """Take all readings; returns the run's folder, with every device let go."""
    recipe, rig = setup.recipe, setup.rig
    with ExitStack() as stack:
        bench_access = stack.enter_context(access(setup, speed))
        clock = bench_access.clock
        folder, begun = new_run_folder(out, recipe.recipe), datetime.now().astimezone()
        stack.callback(_remove_if_empty, folder)
        log = stack.enter_context(wire_log(folder / WIRE_LOG if trace else None, clock))
        bench = stack.enter_context(connected(rig, bench_access.ports, clock, recipe.wavelengths_nm()[0], log))
        attended.check()
        stack.enter_context(sole_writer(folder))
        about = provenance(setup, bench_access.scene_text, begun) | {"devices": devices_text(bench)}
        keep_sensor_files(rig, setup.rig_path, folder)
        stored = stack.enter_context(Journal.create(folder / journal.FILE_NAME, about))
        scan(setup, bench, bench_access, stored, subscribers, attended, live_fit=live_fit)
    return folder


def _remove_if_empty(folder: Path) -> None:
    """Leave no folder of a run that has not begun, because a device was not there."""
    with suppress(OSError):
        folder.rmdir()
