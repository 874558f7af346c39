"""`goniometer stop`: everything that can move, also when another process has it moving."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

from acquisition.protocols import Analyzer, RotaryAxis
from acquisition.stopping import stop_all
from acquisition.timing import POLL_S
from drivers.clock import Clock, Deadline, WallClock
from drivers.wire.wire_log import WireLog
from goniometer.bench_commands.open_bench import Tell, clock_of, reachable_rig
from goniometer.bench_commands.port_lock import Holder, holder_of
from goniometer.errors import DeviceError, GoniometerError
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import DeviceEntry
from goniometer.rig_file import Rig
from goniometer.signals import Interruption
from goniometer.wire_trace import wire_log

_LETS_GO_S = 5.0
"""How long a process that was asked to end may take to stop its bench; an arm at full speed needs part of a second."""

_CLOCK_FREE_S = 1.0


def stop(rig_path: Path, tell: Tell, *, trace: Path | None = None) -> bool:
    """Stop every axis and analyzer of a rig; returns whether all of them were.

    First every process of this program that holds one of the rig's ports is sent SIGTERM, upon which it stops its
    bench. Then, whether it has done so or not, all devices are stopped from here, those on different ports at the same
    time: a port is opened, and the stop is the first that is sent. Ctrl-C does not end this.

    Raises
    ------
    ConfigurationError
        When the rig file cannot be used; nothing was stopped.
    """
    rig = reachable_rig(rig_path)
    real_time = WallClock()
    with Interruption(), ExitStack() as stack:
        _end_holders(rig, real_time, tell)
        clock = _bench_clock(rig, real_time, stack, tell)
        log = _log(trace, clock, stack, tell)
        by_port: dict[str, dict[str, DeviceEntry]] = {}
        for name, device in rig.devices.items():
            if device.port and device.part != "detector":  # without a port: carried by an axis of another device
                by_port.setdefault(device.port, {})[name] = device
        with ThreadPoolExecutor(len(by_port)) as threads:
            outcomes = threads.map(lambda devices: _stop_devices(devices, clock, log), by_port.values())
            told = [_tell_outcome(tell, what, failure) for of_port in outcomes for what, failure in of_port]
    return all(told)


def _tell_outcome(tell: Tell, what: str, failure: BaseException | None) -> bool:
    tell(f"{what}: stopped" if failure is None else f"{what}: NOT STOPPED. {failure}")
    return failure is None


def _end_holders(rig: Rig, clock: Clock, tell: Tell) -> None:
    try:
        holders = _holders(rig)
    except GoniometerError as error:  # the devices matter more than who holds them
        tell(str(error))
        return
    for holder in holders:
        if sys.platform != "win32":
            with suppress(ProcessLookupError):
                os.kill(holder.pid, signal.SIGTERM)
        tell(f"{holder}: holds a port, was asked to stop its bench and end")
    deadline = Deadline(clock, _LETS_GO_S)
    while holders and (holders := _holders(rig)) and not deadline.has_passed():
        clock.sleep(POLL_S)
    for holder in holders:
        tell(f"{holder}: has not let go within {_LETS_GO_S:g} s; end it with: kill -9 {holder.pid}")


def _holders(rig: Rig) -> set[Holder]:
    found = {holder_of(device.port) for device in rig.devices.values()}
    return {holder for holder in found if holder is not None}


def _bench_clock(rig: Rig, real_time: Clock, stack: ExitStack, tell: Tell) -> Clock:
    """The bench's clock, as soon as the program that used it has left it; else real time, which a stop can do with."""
    deadline = Deadline(real_time, _CLOCK_FREE_S)
    while True:
        try:
            return stack.enter_context(clock_of(rig))
        except DeviceError as error:
            if deadline.has_passed():
                tell(f"{error} Real time is used instead.")
                return real_time
        real_time.sleep(POLL_S)


def _log(trace: Path | None, clock: Clock, stack: ExitStack, tell: Tell) -> WireLog | None:
    """The log of the wire; a stop does without one that cannot be written."""
    try:
        return stack.enter_context(wire_log(trace, clock))
    except GoniometerError as error:
        tell(f"No wire log is kept ({error.__cause__})")
        return None


def _stop_devices(
    devices: Mapping[str, DeviceEntry], clock: Clock, log: WireLog | None
) -> list[tuple[str, BaseException | None]]:
    """Stop the devices of one port; what was to be stopped, each with what kept it from being stopped."""
    with ExitStack() as open_devices:
        ports = {name: device.port for name, device in devices.items()}
        bench = Connecting(ports, clock, None, open_devices, log, sets_up=False)
        unreached = {name: _failure(partial(device.connect, name, bench)) for name, device in devices.items()}
        movers: dict[str, RotaryAxis | Analyzer] = {**bench.axes, **bench.analyzers}
        failures = stop_all(list(movers.values()), clock)
        for name, analyzer in bench.analyzers.items():  # a wheel knows no stop, and answers when its turn has ended
            if name not in failures and (failure := _failure(analyzer.slot)) is not None:
                failures[name] = failure
    unreached = {name: failure for name, failure in unreached.items() if failure is not None}
    return [*unreached.items(), *((name, failures.get(name)) for name in movers)]


def _failure(attempt: Callable[[], object]) -> Exception | None:
    try:
        attempt()
    except Exception as error:  # noqa: BLE001 (told; whatever it is, the next device must be stopped too)
        return error
    return None
