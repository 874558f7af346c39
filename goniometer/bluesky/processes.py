"""What goes on at a bench: motions and readings, each looked at when it asks to be, all on the bench's clock."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

from acquisition.timing import POLL_S
from drivers.clock import Clock
from goniometer.bluesky.status import Status

Process = Generator[float, None, None]
"""Goes on from look to look, and says each time how many seconds may pass until the next."""


@dataclass(eq=False)
class _Running:
    device: str
    process: Process
    status: Status
    left_s: float = 0.0


class Processes:
    """Processes that go on at the same time, in one thread.

    What is left until a look is counted down, not read off the clock: in virtual time the bench itself may move the
    clock between two looks at it, and durations would depend on who came first.

    Parameters
    ----------
    clock : Clock
        The bench's clock.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._running: list[_Running] = []

    def __len__(self) -> int:
        return len(self._running)

    def begin(self, device: str, process: Process, status: Status) -> None:
        """Look at a process for the first time; its status is ended when it ends, or raises."""
        running = _Running(device, process, status)
        self._running.append(running)
        self._look(running)

    def pass_time(self) -> bool:
        """Let time pass until the next look, but not longer than a poll; returns whether a process has ended."""
        passed_s = min(POLL_S, *(running.left_s for running in self._running))
        self._clock.sleep(passed_s)
        for running in self._running:
            running.left_s -= passed_s
        before = len(self)
        for running in [running for running in self._running if running.left_s <= 0.0]:
            self._look(running)
        return len(self) < before

    def withdraw(self, device: str, error: BaseException | None) -> None:
        """End what goes on with a device, well or with an error."""
        for running in [running for running in self._running if running.device == device]:
            running.process.close()
            self._end(running, error)

    def withdraw_all(self, error: BaseException) -> None:
        """End everything with an error."""
        for device in {running.device for running in self._running}:
            self.withdraw(device, error)

    def _look(self, running: _Running) -> None:
        try:
            wait_s = next(running.process)
        except StopIteration:
            self._end(running, None)
        except Exception as error:  # noqa: BLE001 (told by the status)
            self._end(running, error)
        else:
            running.left_s = wait_s

    def _end(self, running: _Running, error: BaseException | None) -> None:
        self._running.remove(running)
        running.status.end(error)
