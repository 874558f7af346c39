"""The one thread that owns a bench: whatever is asked of its devices, by whichever thread, is done there in turn.

Drivers know no threads, and a program that uses Bluesky has several: that of the RunEngine, that of Ctrl-C, and that of
the person's script. An exception that is thrown into any of those never cuts an exchange with a device in two.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Protocol, TypeVar

from drivers.clock import Clock
from goniometer.bluesky.conversation import Conversation
from goniometer.bluesky.processes import Process, Processes
from goniometer.bluesky.status import Status
from goniometer.errors import GoniometerError

T = TypeVar("T")

_PATIENCE_S = 10.0
"""Real time after which an event loop that does not turn any more is not listened to."""


class OnClock(Protocol):
    """What the thread opens."""

    @property
    def clock(self) -> Clock:
        """The bench's clock."""
        ...


B = TypeVar("B", bound=OnClock)


@dataclass(frozen=True)
class _Order:
    act: Callable[[], None]
    refuse: Callable[[BaseException], None]
    loop: asyncio.AbstractEventLoop | None = None


class BenchThread:
    """Owns a bench from `open` to `close`."""

    def __init__(self) -> None:
        self._orders: SimpleQueue[_Order] = SimpleQueue()
        self._conversation = Conversation(self._post_own)
        self._processes: Processes
        self._thread: threading.Thread | None = None
        self._closing = threading.Lock()
        self._is_asked_to_leave = self._is_closed = self._time_is_virtual = False
        self._failure: BaseException | None = None

    def open(self, opening: AbstractContextManager[B]) -> B:
        """Enter `opening` in the thread, and return what it gives; the thread leaves it when it is closed."""
        opened: Future[B] = Future()
        self._thread = threading.Thread(target=self._run, args=(opening, opened), name="bench", daemon=True)
        self._thread.start()
        return opened.result()

    def close(self) -> None:
        """Leave the bench; returns when it has been left, even if a signal wants the program to end before.

        Raises
        ------
        BaseException
            What has ended the thread before its time, or kept the bench from being left well.
        """
        if self._thread is None:
            return
        self._post_own(self._leave)
        interruption: BaseException | None = None
        while self._thread.is_alive():
            try:
                self._thread.join()
            except BaseException as error:  # noqa: BLE001 (raised once the bench is safe)
                interruption = error
        self._thread = None
        if (cause := self._failure or interruption) is not None:
            raise cause

    def ask(self, question: Callable[[], T]) -> T:
        """Have something done in the thread, and return its answer, or raise what it raises."""
        if threading.current_thread() is self._thread:
            return question()
        answer: Future[T] = Future()

        def reply() -> None:
            try:
                answer.set_result(question())
            except BaseException as error:  # noqa: BLE001 (raised where it was asked)
                answer.set_exception(error)

        self._post(reply, answer.set_exception)
        return answer.result()

    def begin(self, device: str, order: str, process: Process) -> Status:
        """Let a process go on with a device until it ends; the status, which names the order, tells how it did."""
        status = Status(order)
        self._post(lambda: self._processes.begin(device, process, status), status.end)
        return status

    def withdraw(self, device: str, error: BaseException | None) -> None:
        """End what goes on with a device, well or with an error; for what is asked, in the thread."""
        self._processes.withdraw(device, error)

    def _post(self, act: Callable[[], None], refuse: Callable[[BaseException], None]) -> None:
        order = _Order(act, refuse, _running_loop())
        with self._closing:
            if not self._is_closed:
                self._orders.put(order)
                return
        refuse(self._left())

    def _post_own(self, act: Callable[[], None]) -> None:
        self._orders.put(_Order(act, lambda error: None))

    def _run(self, opening: AbstractContextManager[B], opened: Future[B]) -> None:
        try:
            with opening as bench:
                self._processes = Processes(bench.clock)
                self._time_is_virtual = getattr(bench.clock, "speed", None) == "max"
                opened.set_result(bench)
                self._serve()
        except BaseException as error:  # noqa: BLE001 (raised by `open`, or by `close`)
            if opened.done():
                self._failure = error
            else:
                opened.set_exception(error)
        with self._closing:
            self._is_closed = True
        while not self._orders.empty():
            self._orders.get().refuse(self._left())

    def _serve(self) -> None:
        try:
            while not self._is_asked_to_leave:
                self._go_on()
        except BaseException as error:
            self._failure = error
            raise
        finally:
            self._processes.withdraw_all(self._left())

    def _go_on(self) -> None:
        order = self._next_order()
        if order is None:
            if self._processes.pass_time() and self._time_is_virtual:
                self._conversation.hear_out()
        else:
            order.act()
            if order.loop is not None and self._time_is_virtual:
                self._conversation.hear(order.loop)

    def _next_order(self) -> _Order | None:
        """The next order; None when time may pass, because something goes on and nobody has an order."""
        goes_on = len(self._processes) > 0
        try:
            return self._orders.get(not goes_on or self._conversation.goes_on, _PATIENCE_S if goes_on else None)
        except Empty:
            self._conversation.goes_on = False
            return None

    def _leave(self) -> None:
        self._is_asked_to_leave = True

    def _left(self) -> GoniometerError:
        why = "it was left" if self._failure is None else f"it has failed: {self._failure}"
        return GoniometerError(f"The bench is not open any more ({why}). What was asked of it was not done.")


def _running_loop() -> asyncio.AbstractEventLoop | None:
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None
