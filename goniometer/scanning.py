"""Takes the readings of a scan on a connected bench, reduces and fits them meanwhile, and tells how it ended."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial

from acquisition.course import Course
from acquisition.decisions import Decisions
from acquisition.earlier import Earlier
from acquisition.engine import Bench, Engine, stopped_afterwards
from acquisition.events import ScanEnded, ScanStarted, Subscriber
from acquisition.fit_points import fit_arguments, surface_family
from acquisition.journal import STOPPED, Journal
from acquisition.lamp_level import LampBreak
from acquisition.live_fit import LiveFit
from acquisition.pipeline import Pipeline
from acquisition.pipelines import Pipelines
from acquisition.recipe import Recipe
from acquisition.suspend import Judge, suspensions
from acquisition.time_left import TimeLeft
from acquisition.watchdog import Watchdog
from drivers.clock import Clock
from goniometer.analyzer_rotation import turning
from goniometer.attended import Attended
from goniometer.bench import BenchAccess
from goniometer.errors import JournalError, ScanInterrupted
from goniometer.exposures import nearest_exposure
from goniometer.hang import end_hung
from goniometer.imaging.photographing import photographing
from goniometer.load_files import Setup
from goniometer.planning import aim, averaged, course, enough, plan, reduction, span_s, timing
from goniometer.rig_devices.camera import CameraEntry
from goniometer.run_folder import scene_truth

_SWITCH_INTERVAL_S = 5e-5
"""How long the live fit's thread may keep the interpreter from the scan's; Python's default of 5 ms would be felt."""


def scan(
    setup: Setup,
    bench: Bench,
    bench_access: BenchAccess,
    stored: Journal,
    subscribers: Sequence[Subscriber],
    attended: Attended,
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
    attended : Attended
        Who has a say in it.
    earlier : Earlier, optional
        What is there already.
    notes : tuple of str
        What a person should know beside what the devices said.
    """
    recipe, rig, clock, folder = setup.recipe, setup.rig, bench_access.clock, stored.path.parent
    if recipe.analyzer_rotation is not None:
        bench = turning(bench, rig)
    if isinstance(rig.detector, CameraEntry):
        bench = photographing(bench, recipe)
    with ExitStack() as stack:
        suspended = suspensions(stored.about())
        pipeline = _pipeline(setup, bench_access.scene_text, suspended, subscribers, stack, live_fit=live_fit)
        stack.enter_context(_switching_threads_often())
        started = _started(setup, str(folder), bench_access.scene_text, (*notes, *bench.notes), earlier)
        pipeline.publish(started)
        time_left = TimeLeft(
            clock,
            started.expected_duration_s,
            is_limit=recipe.follows_fit,
            is_longest=recipe.averaging is not None,
            readings=started.readings or 0,
            reading_s=timing(rig, recipe).reading_s,
        )
        decisions = Decisions(stored.about if earlier and earlier.rows else dict, stored.remember)
        way = course(recipe, rig, clock, pipeline.publish, time_left.step_done, decisions)
        watchdog = Watchdog(
            attended.watchdog_s,
            lambda silent_s: end_hung(silent_s, folder, None if rig.is_simulated else setup.rig_path),
        )

        def check() -> None:
            watchdog.feed()
            attended.check()

        attended.control.begin(recipe.exposure_s, partial(nearest_exposure, rig))
        engine = Engine(
            bench,
            clock,
            stored,
            pipeline.publish,
            check,
            time_left,
            enough=enough(recipe, rig),
            earlier=earlier,
            control=attended.control,
            judge=Judge(recipe.suspend, attended.suspend_when),
        )
        try:
            _scan(engine, bench, way, clock, pipeline, watchdog)
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


def _pipeline(
    setup: Setup,
    scene_text: str,
    suspended: Sequence[LampBreak],
    subscribers: Sequence[Subscriber],
    stack: ExitStack,
    *,
    live_fit: bool,
) -> Pipeline | Pipelines:
    """Reduction and live fit of the scan, at each wavelength by itself."""

    def at_one(recipe: Recipe) -> Pipeline:
        fitting = None
        if live_fit and not recipe.follows_fit:
            family = surface_family(recipe.fit, setup.rig.calibration.acceptance_sr)
            fitting = stack.enter_context(LiveFit(family, fit_arguments(recipe.fit)))
        reducing, is_repeated = reduction(recipe, setup.rig, setup.calibration, suspended), recipe.repeats > 1
        return Pipeline(reducing, fitting, subscribers, averaged(recipe, setup.rig), is_repeated=is_repeated)

    listed = setup.recipe.wavelengths_nm()
    if len(listed) == 1:
        return at_one(setup.recipe)
    pipelines = {wavelength_nm: at_one(setup.recipe.at_wavelength(wavelength_nm)) for wavelength_nm in listed}
    truths = {wavelength_nm: scene_truth(scene_text, wavelength_nm) for wavelength_nm in listed}
    return Pipelines(pipelines, truths, subscribers)


def _started(
    setup: Setup, folder: str, scene_text: str, notes: tuple[str, ...], earlier: Earlier | None
) -> ScanStarted:
    """What is known of a scan at its beginning; the steps that are there already take no time."""
    recipe = setup.recipe
    steps = None if recipe.follows_fit else plan(recipe, setup.rig)
    passed_s = sum(step.duration_s for step in earlier.steps[:-1]) if earlier else 0.0
    limit_s = None if recipe.time_limit_s is None else recipe.time_limit_s - (earlier.spent_s if earlier else 0.0)
    return ScanStarted(
        run=folder,
        recipe=recipe.recipe,
        points=None if steps is None else len({step.point for step in steps}),
        readings=None if steps is None or recipe.is_steered else sum(step.readings for step in steps),
        expected_duration_s=span_s(recipe, setup.rig)[1] - passed_s if limit_s is None else max(limit_s, 0.0),
        truth=scene_truth(scene_text, recipe.wavelengths_nm()[0]),
        notes=notes,
        aim=aim(recipe, setup.rig),
        has_planes=not recipe.is_one_plane,
    )


def _scan(
    engine: Engine, bench: Bench, way: Course, clock: Clock, pipeline: Pipeline | Pipelines, watchdog: Watchdog
) -> None:
    start_s = clock.now()

    def tell_end(reason: str, *, as_asked: bool) -> None:
        pipeline.publish(ScanEnded(reason, engine.readings_taken, clock.now() - start_s, as_asked))

    try:
        with stopped_afterwards(bench, clock), watchdog:
            engine.home()
            start_s = clock.now()
            while steps := way.next(pipeline.points):
                engine.run(steps, way.ahead)
                if engine.is_skipped(steps[-1].point):
                    pipeline.leave_out(steps[-1].point)
                elif way.has_measured(pipeline.so_far):
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
