"""What every device of the bench is to Bluesky: a name, and orders that are carried out one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

from acquisition.event_model import data_key
from acquisition.timing import POLL_S
from drivers.clock import Clock, Deadline
from goniometer.bluesky.bench_thread import BenchThread
from goniometer.bluesky.processes import Process
from goniometer.bluesky.status import Status
from goniometer.errors import DeviceFaultError, PositionError

if TYPE_CHECKING:
    from bluesky.protocols import Hints, Reading
    from event_model import DataKey

_REST_S = 10.0


class BenchTime:
    """The bench's clock, and the time of day that it stands for.

    Parameters
    ----------
    clock : Clock
        The bench's clock.
    began_unix_s : float
        When it was at zero, in seconds since 1970. In virtual time only the differences mean anything.
    """

    def __init__(self, clock: Clock, began_unix_s: float) -> None:
        self.clock = clock
        self._began_unix_s = began_unix_s

    def unix_s(self) -> float:
        """Now, in seconds since 1970."""
        return self._began_unix_s + self.clock.now()


class BenchDevice:
    """A device of the bench.

    Parameters
    ----------
    name : str
        What it is called in Bluesky's documents.
    source : str
        What it is, for the documents.
    thread : BenchThread
        Where everything is done.
    time : BenchTime
        Stamps readings.
    configuration : mapping of str to (value, units)
        What its documents say of how it is set up.
    """

    parent = None

    def __init__(
        self,
        name: str,
        source: str,
        thread: BenchThread,
        time: BenchTime,
        configuration: Mapping[str, tuple[Any, str | None]],
    ) -> None:
        self.name = name
        self._source, self._thread, self._time = source, thread, time
        self._configuration: dict[str, tuple[Any, str | None]] = {}
        self._is_busy = False
        self._set_up(configuration)

    def __repr__(self) -> str:
        return self.name  # stands in the start documents of Bluesky's plans

    @property
    def hints(self) -> Hints:
        """What is worth showing."""
        return {"fields": [self.name]}

    def read_configuration(self) -> dict[str, Reading[Any]]:
        """How it is set up."""
        return {key: reading(value, self._set_up_unix_s) for key, (value, _) in self._configuration.items()}

    def describe_configuration(self) -> dict[str, DataKey]:
        """What `read_configuration` returns."""
        return {key: self._data_key(value, units) for key, (value, units) in self._configuration.items()}

    def _set_up(self, configuration: Mapping[str, tuple[Any, str | None]]) -> None:
        """Note how it is set up, from now on."""
        self._configuration |= {f"{self.name}_{key}": value for key, value in configuration.items()}
        self._set_up_unix_s = self._time.unix_s()

    def _data_key(self, value: Any, units: str | None) -> DataKey:
        return data_key(value, self._source, units)

    def _begin(self, order: str, process: Process) -> Status:
        return self._thread.begin(self.name, order, self._in_turn(process))

    def _in_turn(self, process: Process) -> Process:
        """Let the order before come to its end: after a pause, Bluesky repeats one that may still be under way."""
        while self._is_busy:
            yield POLL_S
        self._is_busy = True
        try:
            yield from process
        finally:
            self._is_busy = False


class Mover(Protocol):
    """What stops, and comes to rest."""

    settle_s: float

    def is_moving(self) -> bool:
        """Ask the device."""
        ...

    def stop(self) -> None:
        """Stop; safe at any time."""
        ...


class MovingDevice(BenchDevice):
    """A device of the bench that moves, and stops when Bluesky pauses, aborts or halts."""

    _mover: Mover
    _was_stopped = False

    def stop(self, success: bool = True) -> None:
        """Stop at once; the order under way ends well, or as failed, as Bluesky wants it.

        Raises
        ------
        DeviceError
            When the device cannot be stopped.
        """
        self._thread.ask(lambda: self._stop(success))

    def _stop(self, success: bool) -> None:
        self._was_stopped = True
        try:
            self._mover.stop()
        finally:
            self._thread.withdraw(self.name, None if success else self._stopped_on_its_way())

    def _until_at_rest(self) -> Process:
        """Poll until the device has arrived and settled."""
        yield POLL_S
        while self._mover.is_moving():
            yield POLL_S
        yield self._mover.settle_s

    def _until_stopped(self) -> Process:
        """After a stop, poll until the device stands: from there the next way is reckoned."""
        deadline = Deadline(self._time.clock, _REST_S)
        while self._was_stopped and self._mover.is_moving():
            if deadline.has_passed():
                raise DeviceFaultError(
                    self.name,
                    f"it still moves {_REST_S:g} s after it was told to stop",
                    not_done="nothing else was ordered, and it may be anywhere",
                    to_do="cut its power now",
                )
            yield POLL_S
        self._was_stopped = False

    def _stopped_on_its_way(self) -> PositionError:
        return PositionError(
            self.name,
            "it was told to stop on its way",
            not_done="it is not where it was sent",
            to_do="see why it was stopped, then send it again",
        )


def reading(value: Any, unix_s: float) -> Reading[Any]:
    """A value and when it was measured, as Bluesky has them."""
    return {"value": value, "timestamp": unix_s}
