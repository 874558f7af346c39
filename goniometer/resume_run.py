"""Take a scan up again that was cut short: the same folder, the same journal, from the first missing reading on."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import yaml

from acquisition import journal
from acquisition.control import ScanControl
from acquisition.earlier import Earlier
from acquisition.events import Subscriber
from acquisition.expand import HOME, Target
from acquisition.journal import LINK_LOST, Journal
from acquisition.orders import ORDERED, skipped_points
from acquisition.recipe import Recipe
from acquisition.retrace import Retraced, recorded, retrace
from acquisition.steering import spent_s
from acquisition.suspend import SUSPENDED, SuspendWhen
from acquisition.watchdog import LIMIT_S
from drivers.clock import WallClock
from goniometer.assembly import connected
from goniometer.attended import Attended
from goniometer.bench import LeftOff, Speed, access
from goniometer.errors import ConfigurationError
from goniometer.load_files import Setup
from goniometer.planning import alike, course, enough, references
from goniometer.resume_checks import (
    file_notes,
    refuse_other_bench,
    refuse_other_devices,
    rig_to_go_on_with,
    version_notes,
)
from goniometer.run_folder import StoredRun, remembered, stored_run
from goniometer.run_lock import sole_writer
from goniometer.run_recipe import results
from goniometer.run_results import write_results
from goniometer.scanning import scan
from goniometer.signals import Interruption
from goniometer.standing import come_to_rest, out_of_place
from goniometer.wire_trace import WIRE_LOG, wire_log
from sim_devices.past import Past
from sim_devices.scene import Scene

SAME_SAMPLE = (
    "Nobody but you can see whether the same sample is still mounted as it was, and the lamp as bright. Is it so?"
)


@dataclass(frozen=True)
class Resumed:
    """A run that was taken up; `was_finished` says that there was nothing left to measure."""

    run: StoredRun
    was_finished: bool


def resume(
    run: str | Path,
    *,
    rig_path: str | Path | None = None,
    speed: Speed | None = None,
    is_same_sample: Callable[[], bool] = lambda: False,
    live_fit: bool = True,
    trace: bool = False,
    subscribers: Sequence[Subscriber] = (),
    control: ScanControl | None = None,
    suspend_when: SuspendWhen | None = None,
    watchdog_s: float = LIMIT_S,
) -> Resumed:
    """Continue a run at its first missing reading, in its folder and its journal, and write the results.

    The recipe and the rig are those that the journal holds. Whoever subscribes is told the whole scan, first what is
    there already.

    Parameters
    ----------
    run : str or Path
        The run's folder, or the journal in it.
    rig_path : str or Path, optional
        A rig file that differs from the journal's in nothing but ports.
    speed, live_fit, trace, subscribers, control, suspend_when, watchdog_s
        As for `goniometer.run`.
    is_same_sample : callable
        Asked once when the bench is real.

    Returns
    -------
    Resumed
        The run, read back from its journal.

    Raises
    ------
    ConfigurationError
        When bench, recipe or sample are not those of the run; nothing was opened or moved.
    JournalError
        When another process writes the run, or its journal cannot be read or written.
    DeviceError
        When a device fails, is another one than before, or sees other light than before.
    ScanInterrupted
        On Ctrl-C, SIGTERM or SIGHUP. The run can be resumed again.
    """
    folder = Path(run)
    if folder.name == journal.FILE_NAME:
        folder = folder.parent
    Journal.open(folder / journal.FILE_NAME).close()  # says what is wrong with it before there is a lock in the folder
    with Interruption() as interruption, sole_writer(folder):
        with Journal.go_on(folder / journal.FILE_NAME) as stored:
            was_finished = "ended" in stored.about()
            if not was_finished:
                attended = Attended(interruption, control or ScanControl(), suspend_when, watchdog_s)
                _go_on(stored, rig_path, speed, is_same_sample, live_fit, trace, subscribers, attended)
        if was_finished:
            found = stored_run(folder)
            if not (folder / "fit.json").exists():
                write_results(found)
            return Resumed(found, was_finished=True)
        return Resumed(results(folder, subscribers, interruption), was_finished=False)


def _go_on(
    stored: Journal,
    rig_path: str | Path | None,
    speed: Speed | None,
    is_same_sample: Callable[[], bool],
    live_fit: bool,
    trace: bool,
    subscribers: Sequence[Subscriber],
    attended: Attended,
) -> None:
    about, taken, folder = stored.about(), stored.taken(), stored.path.parent
    setup = _setup(folder, about, Path(rig_path) if rig_path else None)
    decisions = recorded(about)
    way = course(setup.recipe, setup.rig, WallClock(), lambda event: None, lambda saved_s: None, decisions)
    planned = [row.reading for row in taken if row.is_planned]
    gone = retrace(way, planned, skipped_points(about), enough(setup.recipe, setup.rig))
    if gone.is_whole:
        stored.remember("ended", way.reason)
        return
    if setup.scene is None and setup.rig.bench is None and not is_same_sample():
        raise ConfigurationError(
            [f"{folder} was not resumed, and nothing was moved: {SAME_SAMPLE} If so, say --sample-untouched."]
        )
    earlier = Earlier(
        taken,
        gone.steps,
        references(setup.recipe, setup.rig),
        alike(setup.recipe, setup.rig),
        is_steady=not any(key.startswith((LINK_LOST, ORDERED, SUSPENDED)) for key in about),
    )
    if setup.recipe.follows_fit and taken:
        earlier = replace(earlier, spent_s=spent_s(decisions, earlier.ended_s))
    left_off, notes = _left_off(stored, earlier, speed)
    with ExitStack() as stack:
        bench_access = stack.enter_context(access(setup, speed, left_off))
        refuse_other_bench(about["scene"], bench_access.scene_text)
        log = stack.enter_context(wire_log(folder / WIRE_LOG if trace else None, bench_access.clock))
        bench = stack.enter_context(
            connected(setup.rig, bench_access.ports, bench_access.clock, setup.recipe.wavelengths_nm()[0], log)
        )
        refuse_other_devices(about.get("devices", ""), bench.identities)
        if setup.scene is None:  # a bench that has outlived the process that was cut short
            come_to_rest(bench, bench_access.clock, attended.check)
            bench = replace(bench, to_home=out_of_place(bench, setup.rig, _places(gone, earlier, stored)))
        attended.check()
        stored.begin_again(
            datetime.now().astimezone().isoformat(timespec="seconds"),
            f"goniometer {importlib.metadata.version('goniometer')} on {platform.node()}",
        )
        notes = (
            f"resumed: {len(taken)} readings are there{_missing(setup.recipe, gone, len(planned))}; "
            f"{stored.interruptions()[-1]}",
            *notes,
            *file_notes(about),
            *version_notes(about),
        )
        scan(
            setup,
            bench,
            bench_access,
            stored,
            subscribers,
            attended,
            live_fit=live_fit,
            earlier=earlier,
            notes=notes,
        )


def _setup(folder: Path, about: dict[str, str], rig_path: Path | None) -> Setup:
    """What the journal says was to be measured, on the devices that it names, perhaps at other ports."""
    if "calibrate" in yaml.safe_load(about["recipe"]):
        raise ConfigurationError(
            [
                f"{folder} was not resumed: it is a scan of a calibration, which is measured anew as a whole, with "
                "goniometer calibrate and its recipe. Nothing was moved."
            ]
        )
    recipe, rig, calibration = remembered(folder, about)
    rig_text, rig_file = about["rig"], Path(about["rig_file"])
    if rig_path is not None:
        rig, rig_file = rig_to_go_on_with(rig, rig_path), rig_path
    scene = Scene.model_validate(yaml.safe_load(about["scene"])) if rig.is_simulated else None
    return Setup(
        recipe=recipe,
        recipe_path=Path(about["recipe_file"]),
        recipe_text=about["recipe"],
        rig=rig,
        rig_path=rig_file,
        rig_text=rig_text,
        scene=scene,
        scene_path=Path(about["scene_file"]) if scene and "scene_file" in about else None,
        scene_text=about["scene"] if scene else "",
        calibration=calibration,
        calibration_text=about.get("calibration", ""),
    )


def _missing(recipe: Recipe, gone: Retraced, there: int) -> str:
    """How many readings are missing, where that is known before they are taken."""
    if recipe.is_steered:
        return ""
    return f", {sum(step.readings for step in (*gone.steps, *gone.ahead)) - there} are missing"


def _left_off(stored: Journal, earlier: Earlier, speed: Speed | None) -> tuple[LeftOff | None, tuple[str, ...]]:
    """How the bench was left; with a note when the computer's clock cannot tell how long ago."""
    stored_at = stored.last_stored_at()
    if stored_at is None:
        return None, ()
    ago_s = (datetime.now(UTC) - datetime.fromisoformat(stored_at)).total_seconds()
    again = len(earlier.of_last_step) if speed == "max" and earlier.can_come_again else 1
    again += len(earlier.visited) > 1  # and one of the step before
    past = Past(len(earlier.rows) - again, _turns([step.target for step in earlier.visited[:-1]]) - _turns(earlier.way))
    note = (
        f"the computer's clock was set back: the last reading was stored at {stored_at}, which has not come yet; no "
        "time is taken to have gone",
    )
    return LeftOff(earlier.ended_s, max(0.0, ago_s), past), note if ago_s < 0 else ()


def _places(gone: Retraced, earlier: Earlier, stored: Journal) -> tuple[Target, ...]:
    """Where a program that was killed may have left the bench: it leaves a place before the last reading is stored."""
    places = [HOME, *(step.target for step in gone.steps)][-1:] + [step.target for step in gone.ahead[:2]]
    if stored.interruptions() and earlier.steps:  # it may have been on its way to where it was to go on
        places += [*earlier.way, *(step.target for step in earlier.references(earlier.steps[-1].point))]
    return tuple(places)


def _turns(targets: Sequence[Target]) -> int:
    """How often the analyzer turns on the way from home."""
    slots = [HOME.slot, *(target.slot for target in targets)]
    return sum(before != after for before, after in pairwise(slots))
