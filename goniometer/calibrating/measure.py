"""Takes the readings of a calibration: one scan for each angle to which a person turns the reference."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import yaml

from acquisition import journal
from acquisition.calibration_recipe import calibration_steps
from acquisition.engine import Engine, stopped_afterwards
from acquisition.events import Event, LinkRestored
from acquisition.journal import Journal
from acquisition.time_left import TimeLeft
from goniometer.assembly import connected
from goniometer.bench import Speed, access
from goniometer.durations import clock_text
from goniometer.load_files import CalibrationSetup
from goniometer.planning import slots, timing
from goniometer.provenance import provenance
from goniometer.run_folder import new_run_folder
from goniometer.run_lock import sole_writer
from goniometer.signals import Interruption
from sim_devices.effects.reference_polarizer import ReferencePolarizer

Tell = Callable[[str], None]
"""Takes a line for the person who waits."""

SETTING = "reference_deg"
"""Where a journal remembers to what the reference was turned by hand."""


def measure(setup: CalibrationSetup, out: Path, speed: Speed | None, ask: Tell, tell: Tell) -> Iterator[Path]:
    """Take all scans of a calibration's recipe; yields each run's folder once its readings are complete.

    Parameters
    ----------
    setup : CalibrationSetup
        What to measure.
    out : Path
        Where the runs' folders are made.
    speed : float or "max", optional
        Time scale of a simulated bench.
    ask : callable
        Given what a person has to do; returns when it is done. A simulated reference is turned by the program.
    tell : callable
        Given what goes on.

    Raises
    ------
    DeviceError
        When a device fails. The bench is stopped; scans that are complete stay of use.
    ScanInterrupted
        On Ctrl-C, SIGTERM or SIGHUP; likewise.
    """
    for number, setting_deg in enumerate(setup.recipe.calibrate.hand_settings_deg()):
        if setting_deg is None:
            yield _scan(setup, None, out, speed, tell)
        elif setup.rig.is_simulated:
            yield _scan(_turned(setup, setting_deg, number), setting_deg, out, speed, tell)
        else:
            ask(f"Turn the reference polarizer to {setting_deg:g} degrees, take your hands out of the light")
            yield _scan(setup, setting_deg, out, speed, tell)


def _turned(setup: CalibrationSetup, setting_deg: float, number: int) -> CalibrationSetup:
    """The same bench with its simulated reference polarizer at another angle, and with noise of its own."""
    assert setup.scene is not None, "a simulated rig is only accepted with a scene"
    effects = tuple(
        effect.model_copy(update={"angle_deg": setting_deg}) if isinstance(effect, ReferencePolarizer) else effect
        for effect in setup.scene.effects
    )
    scene = setup.scene.model_copy(update={"effects": effects, "seed": setup.scene.seed + number})
    text = yaml.safe_dump(scene.model_dump(mode="json", exclude_none=True), sort_keys=False)
    return replace(setup, scene=scene, scene_text=text)


def _scan(setup: CalibrationSetup, setting_deg: float | None, out: Path, speed: Speed | None, tell: Tell) -> Path:
    recipe, rig = setup.recipe, setup.rig
    steps = calibration_steps(recipe, slots(rig, recipe.wavelength_nm), timing(rig))
    duration_s = sum(step.duration_s for step in steps)

    def publish(event: Event) -> None:
        if isinstance(event, LinkRestored):
            tell(str(event))

    with ExitStack() as stack:
        interruption = stack.enter_context(Interruption())
        reached = stack.enter_context(access(setup, speed))
        bench = stack.enter_context(connected(rig, reached.ports, reached.clock, recipe.wavelength_nm))
        interruption.check()
        named = recipe.recipe if setting_deg is None else f"{recipe.recipe} {setting_deg:g} deg"
        folder, begun = new_run_folder(out, named), datetime.now().astimezone()
        stack.enter_context(sole_writer(folder))
        about = provenance(setup, reached.scene_text, begun)
        if setting_deg is not None:
            about[SETTING] = repr(setting_deg)
        stored = stack.enter_context(Journal.create(folder / journal.FILE_NAME, about))
        tell(f"{folder}: {sum(step.readings for step in steps)} readings, {clock_text(duration_s)}")
        engine = Engine(bench, reached.clock, stored, publish, interruption.check, TimeLeft(reached.clock, duration_s))
        with stopped_afterwards(bench, reached.clock):
            engine.home()
            engine.run(steps)
        stored.remember("ended", "finished")
    return folder
