"""A bench opened for Bluesky, in a thread of its own: its devices, homed when asked, and all stopped on the way out."""

from __future__ import annotations

import atexit
import importlib.util
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from acquisition.protocols import HomingAxis
from acquisition.timing import POLL_S
from drivers.clock import Clock
from goniometer.bench import Speed
from goniometer.bench_commands.measuring import USUAL_EXPOSURE_S
from goniometer.bluesky.analyzer import BlueskyAnalyzer
from goniometer.bluesky.axis import BlueskyAxis
from goniometer.bluesky.bench_thread import BenchThread
from goniometer.bluesky.detector import BlueskyDetector
from goniometer.bluesky.device import BenchTime
from goniometer.bluesky.ended_by_signals import ended_by_signals
from goniometer.bluesky.opened import Opened, opened_bench
from goniometer.bluesky.processes import Process
from goniometer.errors import ConfigurationError, DeviceFaultError
from goniometer.rig_devices.entry import AxesEntry, Role


@dataclass(frozen=True)
class BlueskyBench:
    """The devices of a bench, by their roles.

    Attributes
    ----------
    source_arm, detector_arm, sample_azimuth : BlueskyAxis
        Motors, in degrees.
    detector_azimuth : BlueskyAxis or None
        A motor likewise; None on a bench without one.
    analyzer : BlueskyAnalyzer
        A positioner of numbered slots.
    detector : BlueskyDetector
        Triggered and read, in watts.
    clock : Clock
        The bench's clock.
    notes : tuple of str
        What devices said on connecting.
    """

    source_arm: BlueskyAxis
    detector_arm: BlueskyAxis
    sample_azimuth: BlueskyAxis
    analyzer: BlueskyAnalyzer
    detector: BlueskyDetector
    clock: Clock
    notes: tuple[str, ...]
    _to_home: tuple[HomingAxis, ...]
    _thread: BenchThread
    detector_azimuth: BlueskyAxis | None = None

    def home(self) -> None:
        """Home the axes that the rig file says are to be homed at every start, one after the other; no plan, but waits.

        Raises
        ------
        DeviceError
            When an axis does not find its home position.
        """
        for axis in self._to_home:
            self._thread.begin(axis.name, f"search of {axis.name} for its home position", _homing(axis)).wait()


@contextmanager
def devices(
    path: str | Path,
    *,
    speed: Speed | None = None,
    wavelength_nm: float | None = None,
    exposure_s: float = USUAL_EXPOSURE_S,
) -> Iterator[BlueskyBench]:
    """Open a bench for Bluesky's RunEngine while the block lasts; whatever ends the block, every device is stopped.

    Connecting moves nothing. SIGTERM and SIGHUP end the block, as `goniometer stop` wants it.

    Parameters
    ----------
    path : str or Path
        A rig file: of real devices, or as printed by `goniometer simulate`. Or a scene, which is simulated here.
    speed : float or "max", optional
        Of a scene: seconds of the bench in a second of real time, 1 if not given; "max" is virtual time.
    wavelength_nm : float, optional
        Told to detectors whose response depends on it; without it they keep the one that they have.
    exposure_s : float
        Of one reading, to begin with.

    Yields
    ------
    BlueskyBench
        Its devices satisfy `bluesky.protocols`.

    Raises
    ------
    ConfigurationError
        When Bluesky is not installed, or the file cannot be used; nothing was opened.
    DeviceError
        When a device fails, cannot be stopped at the end, or another process holds its port.
    ScanInterrupted
        On SIGTERM or SIGHUP.
    """
    if importlib.util.find_spec("bluesky") is None:
        raise ConfigurationError(
            ["Bluesky is not installed. No device was opened. Run: pip install 'goniometer[bluesky]'"]
        )
    thread = BenchThread()
    with ended_by_signals():
        atexit.register(thread.close)  # a session that is left without leaving the block
        try:
            opened = thread.open(opened_bench(Path(path), speed, wavelength_nm))
            yield _devices_of(opened, thread, exposure_s, wavelength_nm)
        finally:
            thread.close()
            atexit.unregister(thread.close)


def _devices_of(opened: Opened, thread: BenchThread, exposure_s: float, wavelength_nm: float | None) -> BlueskyBench:
    rig, bench, clock = opened.rig, opened.bench, opened.clock
    bench_time = BenchTime(clock, time.time() - clock.now())
    sources = {entry.part: f"{entry.driver} {name}" for name, entry in rig.devices.items()}
    for name, entry in rig.devices.items():
        if isinstance(entry, AxesEntry):
            sources |= dict.fromkeys(entry.axes, f"{entry.driver} {name}")

    def axis(role: Role) -> BlueskyAxis:
        return BlueskyAxis(role, opened.axis(role), rig.axes()[role], sources[role], thread, bench_time)

    return BlueskyBench(
        axis("source_arm"),
        axis("detector_arm"),
        axis("sample_azimuth"),
        BlueskyAnalyzer(bench.analyzer, rig.analyzer, sources["analyzer"], thread, bench_time),
        BlueskyDetector(
            bench.detector,
            rig.detector,
            sources["detector"],
            thread,
            bench_time,
            exposure_s=exposure_s,
            wavelength_nm=wavelength_nm,
        ),
        clock,
        bench.notes,
        bench.to_home,
        thread,
        axis("detector_azimuth") if "detector_azimuth" in rig.axes() else None,
    )


def _homing(axis: HomingAxis) -> Process:
    axis.start_homing()
    yield POLL_S
    while axis.is_moving():
        yield POLL_S
    yield axis.settle_s
    if not axis.is_homed():
        raise DeviceFaultError(
            axis.name,
            "its controller says that the search for the home position has ended, and that it is not known",
            not_done="the other axes were not homed",
            to_do="look at the stage, its home switch and its cable, then home it again",
        )
