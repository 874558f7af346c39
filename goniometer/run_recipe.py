"""Run a recipe from beginning to end: bench, scan, live fit, results."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime
from pathlib import Path

from acquisition import journal
from acquisition.course import Course
from acquisition.earlier import Earlier
from acquisition.engine import Bench, Engine, stopped_afterwards
from acquisition.events import FitUpdated, ScanEnded, ScanStarted, Subscriber
from acquisition.fit_points import fit_arguments, surface_family
from acquisition.journal import STOPPED, Journal
from acquisition.live_fit import LiveFit
from acquisition.pipeline import Pipeline
from acquisition.time_left import TimeLeft
from drivers.clock import Clock
from goniometer.assembly import connected
from goniometer.bench import BenchAccess, Speed, access
from goniometer.errors import JournalError, ScanInterrupted
from goniometer.load_files import Setup, load_recipe
from goniometer.planning import aim, averaged, course, enough, plan, reduction, span_s
from goniometer.provenance import devices_text, provenance
from goniometer.run_folder import StoredRun, new_run_folder, scene_truth, stored_run, write_results
from goniometer.run_lock import sole_writer
from goniometer.signals import Interruption
from goniometer.wire_trace import WIRE_LOG, wire_log

_SWITCH_INTERVAL_S = 5e-5
"""How long the live fit's thread may keep the interpreter from the scan's; Python's default of 5 ms would be felt."""


def run(
    recipe_path: str | Path,
    *,
    rig_path: str | Path | None = None,
    out: str | Path = "runs",
    speed: Speed | None = None,
    live_fit: bool = True,
    trace: bool = False,
    subscribers: Sequence[Subscriber] = (),
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
        On Ctrl-C, SIGTERM or SIGHUP; likewise.
    """
    setup = load_recipe(Path(recipe_path), Path(rig_path) if rig_path else None)
    with Interruption() as interruption:
        folder = _measure(setup, Path(out), speed, live_fit, trace, subscribers, interruption)
        return results(folder, subscribers, interruption)


def results(folder: Path, subscribers: Sequence[Subscriber], interruption: Interruption) -> StoredRun:
    """Fit what a scan has measured, tell it, and write it beside the journal."""
    try:
        interruption.check()
        result = stored_run(folder)
        if result.fit is not None:
            for subscriber in subscribers:
                subscriber(FitUpdated(len(result.points), result.fit))
        interruption.check()
        write_results(result)
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
    interruption: Interruption,
) -> Path:
    """Take all readings; returns the run's folder, with every device let go."""
    recipe, rig = setup.recipe, setup.rig
    with ExitStack() as stack:
        bench_access = stack.enter_context(access(setup, speed))
        clock = bench_access.clock
        folder, begun = new_run_folder(out, recipe.recipe), datetime.now().astimezone()
        stack.callback(_remove_if_empty, folder)
        log = stack.enter_context(wire_log(folder / WIRE_LOG if trace else None, clock))
        bench = stack.enter_context(connected(rig, bench_access.ports, clock, recipe.wavelength_nm, log))
        interruption.check()
        stack.enter_context(sole_writer(folder))
        about = provenance(setup, bench_access.scene_text, begun) | {"devices": devices_text(bench)}
        stored = stack.enter_context(Journal.create(folder / journal.FILE_NAME, about))
        scan(setup, bench, bench_access, stored, subscribers, interruption, live_fit=live_fit)
    return folder


def scan(
    setup: Setup,
    bench: Bench,
    bench_access: BenchAccess,
    stored: Journal,
    subscribers: Sequence[Subscriber],
    interruption: Interruption,
    *,
    live_fit: bool,
    earlier: Earlier | None = None,
    notes: tuple[str, ...] = (),
) -> None:
    """Take all readings that are not there yet, in the calling thread.

    Parameters
    ----------
    setup : Setup
        What to measure with which devices.
    bench, bench_access
        The devices, connected, and their clock.
    stored : Journal
        Where the readings go.
    subscribers, live_fit
        As for `run`.
    interruption : Interruption
        Ends the scan.
    earlier : Earlier, optional
        What is there already.
    notes : tuple of str
        What a person should know beside what the devices said.
    """
    recipe, rig, clock, folder = setup.recipe, setup.rig, bench_access.clock, stored.path.parent
    with ExitStack() as stack:
        fitting = None
        if live_fit and not recipe.follows_fit:
            family = surface_family(recipe.fit, rig.calibration.acceptance_sr)
            fitting = stack.enter_context(LiveFit(family, fit_arguments(recipe.fit)))
        reducing = reduction(recipe, rig, setup.calibration)
        is_repeated = recipe.repeats > 1
        pipeline = Pipeline(reducing, fitting, subscribers, averaged(recipe, rig), is_repeated=is_repeated)
        stack.enter_context(_switching_threads_often())
        started = _started(setup, str(folder), bench_access.scene_text, (*notes, *bench.notes), earlier)
        pipeline.publish(started)
        time_left = TimeLeft(
            clock,
            started.expected_duration_s,
            is_limit=recipe.follows_fit,
            is_longest=recipe.averaging is not None,
        )
        way = course(recipe, rig, clock, pipeline.publish, time_left.step_done)
        engine = Engine(
            bench, clock, stored, pipeline.publish, interruption.check, time_left, enough(recipe, rig), earlier
        )
        try:
            _scan(engine, bench, way, clock, pipeline)
        except BaseException as error:
            with suppress(JournalError):  # on a full disk it is not known later why the scan has stopped
                stored.remember(STOPPED, error.reason if isinstance(error, ScanInterrupted) else str(error))
            if engine.readings_taken or earlier:
                error.add_note(
                    f"Every reading shown is stored. Look at them with: goniometer fit {folder}\n"
                    f"Go on with: goniometer resume {folder}"
                )
            else:
                error.add_note(f"No reading had been taken; {folder} holds none.")
            raise
        stored.remember("ended", way.reason)


def _remove_if_empty(folder: Path) -> None:
    """Leave no folder of a run that has not begun, because a device was not there."""
    with suppress(OSError):
        folder.rmdir()


def _started(
    setup: Setup, folder: str, scene_text: str, notes: tuple[str, ...], earlier: Earlier | None
) -> ScanStarted:
    """What is known of a scan at its beginning; the steps that are there already take no time."""
    recipe = setup.recipe
    steps = None if recipe.follows_fit else plan(recipe, setup.rig)
    passed_s = sum(step.duration_s for step in earlier.steps[:-1]) if earlier else 0.0
    return ScanStarted(
        run=folder,
        recipe=recipe.recipe,
        points=None if steps is None else len({step.point for step in steps}),
        readings=None if steps is None or recipe.is_steered else sum(step.readings for step in steps),
        expected_duration_s=recipe.time_limit_s or span_s(recipe, setup.rig)[1] - passed_s,
        truth=scene_truth(scene_text),
        notes=notes,
        aim=aim(recipe, setup.rig),
        has_planes=not recipe.is_one_plane,
    )


def _scan(engine: Engine, bench: Bench, way: Course, clock: Clock, pipeline: Pipeline) -> None:
    start_s = clock.now()

    def tell_end(reason: str, *, as_asked: bool) -> None:
        pipeline.publish(ScanEnded(reason, engine.readings_taken, clock.now() - start_s, as_asked))

    try:
        with stopped_afterwards(bench, clock):
            engine.home()
            start_s = clock.now()
            while steps := way.next(pipeline.points):
                engine.run(steps, way.ahead)
                if way.has_measured(pipeline.so_far):
                    pipeline.end_point()
    except BaseException as error:
        try:
            tell_end(str(error) or type(error).__name__, as_asked=False)
        except Exception as telling:  # noqa: BLE001 (noted: why the scan ended matters more than who could not hear it)
            error.add_note(f"Its end could not be shown or timed: {telling}")
        raise
    tell_end(way.reason, as_asked=True)


@contextmanager
def _switching_threads_often() -> Iterator[None]:
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before_s)
