"""The one loop that serves every port of a bench: takes bytes, asks the device, sends replies when they are due."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence

from goniometer.errors import DeviceFaultError
from sim_devices.device import Device, Due, Later, Passing, hang_up
from sim_devices.serving.agenda import Agenda, Entry
from sim_devices.serving.clients import Between, Clients
from sim_devices.serving.clock import BenchClock
from sim_devices.serving.served_link import ServedLink
from sim_devices.serving.waker import Waker

# virtual time does not tell when it has passed what a device will say on its own; real seconds from look to look
_LOOK_S = 0.001

# how long, in real seconds, virtual time waits for clients before it goes to what a device will tell one on its own:
# longer than a program that speaks to several devices is silent between two of them
_PATIENCE_S = 0.25

# how long it waits, in real seconds, for one who has waited on the clock: who does so once does again, and comes late
# only where the computer has no time for it, which must not change what is measured
_PATIENCE_WITH_WAITING_S = 10.0


class Reactor:
    """Serves its ports in a thread of its own, and in any thread that calls `serve`; only one of them at a time.

    Parameters
    ----------
    clock : BenchClock
        Tells when a reply is due. Virtual time goes there as soon as no client has anything more to say; to what a
        device will say on its own it comes when somebody waits or is answered, or when nobody stirs for a while, which
        is long when somebody has waited.
    """

    def __init__(self, clock: BenchClock) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        self._agenda: Agenda[ServedLink | None] = Agenda()
        self._failure: BaseException | None = None
        self._is_stopping = False
        self._stirred_s = time.monotonic()
        self._waited_s = -math.inf
        self._thread = threading.Thread(target=self._run, name="simulated bench", daemon=True)
        self._waker = Waker(self._thread)
        self._clients = Clients(self._hear, self._agenda.forget, self._waker)

    def listen(self, device: Device) -> int:
        """Serve a device's clients at a free loopback port; returns its number."""
        with self._lock:
            return self._clients.listen(device)

    def open_pty(self, device: Device) -> str:
        """Serve a device's clients at a pseudo-terminal; returns its path.

        Raises
        ------
        OSError
            If the system has none to give.
        """
        with self._lock:
            return self._clients.open_pty(device)

    def stand_between(self, device: Device, between: Between) -> None:
        """Have something stand between a device and its clients, those that it has and those to come."""
        with self._lock:
            self._clients.stand_between(device, between)

    def at(self, time_s: float, act: Later) -> None:
        """Let something happen to the bench itself, in its turn among all that is said; what follows is no bytes."""
        with self._lock:
            self._agenda.add(time_s, None, act, is_reply=False)
            self._waker.call()

    def say(self, device: Device, data: bytes) -> None:
        """Let all clients of a device hear something now."""
        with self._lock:
            for link in self._clients.of(device):
                self._clients.say(link, data, is_reply=False)

    def cut(self, device: Device, *, hangs_up: bool) -> None:
        """Lose all that is on its way to a device's clients, and their connections too when it hangs up."""
        with self._lock:
            for link in self._clients.of(device):
                self._agenda.drop_bytes(link)
                link.lose(hangs_up=hangs_up)
                self._clients.watch(link)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close every port."""
        self._is_stopping = True
        if self._thread.is_alive():
            self._waker.call()
            self._thread.join()
        with self._lock:
            self._clients.close()
            self._waker.close()

    def serve(self) -> None:
        """Take everything that clients have sent, and answer what is due; raises what stops the bench."""
        with self._lock:
            self.raise_failure()
            if self._is_stopping:
                return
            self._stirred_s = self._waited_s = time.monotonic()
            try:
                self._serve()
            except BaseException as failure:
                self._failure = failure
                self._waker.call()
                raise

    def raise_failure(self) -> None:
        """Raise what has stopped the bench, if anything has.

        Raises
        ------
        DeviceFaultError
            With the error in the bench's own code as its cause.
        """
        if self._failure is not None:
            raise DeviceFaultError(
                "simulated bench",
                f"it has stopped because of an error in its own code ({self._failure!r})",
                not_done="nothing that was sent to a simulated device since then has been answered",
                to_do="start the bench again, and report the error below if it comes back",
            ) from self._failure

    def _run(self) -> None:
        try:
            while not self._is_stopping and self._failure is None:
                # another thread may serve meanwhile; what it has answered is simply no longer there
                self._clients.wait(self._real_s_until_due())
                with self._lock:
                    # only this thread takes the calls: one taken by another would not have woken it
                    self._waker.hear()
                    self._go_on_when_all_wait()
                    self._serve()
                    self._clients.close_gone()
        except BaseException as failure:  # noqa: BLE001 - kept, and raised by whoever asks next
            self._failure = failure
        finally:
            # a client that waits for a reply should see at once that none will come
            with self._lock:
                self._clients.close()

    def _go_on_when_all_wait(self) -> None:
        wait_s = max(self._stirred_s + _PATIENCE_S, self._waited_s + _PATIENCE_WITH_WAITING_S)
        if (due_s := self._agenda.next_told_s) is None or time.monotonic() < wait_s:
            return
        self._stirred_s = time.monotonic()
        self._clock.reach(due_s)

    def _real_s_until_due(self) -> float | None:
        with self._lock:
            reply_s, unasked_s = self._agenda.next_reply_s, self._agenda.next_unasked_s
            waits_s = [] if reply_s is None else [self._clock.real_s_until(reply_s)]
            if unasked_s is not None:
                waits_s.append(self._clock.real_s_until(unasked_s) or _LOOK_S)
            return min(waits_s, default=None)

    def _serve(self) -> None:
        while True:
            # what was due by now has been said, whatever a client says now
            self._send_due()
            if self._clients.attend():
                self._stirred_s = time.monotonic()
            elif (due_s := self._agenda.next_reply_s) is None or not self._clock.reach(due_s):
                return

    def _hear(self, link: ServedLink, data: bytes) -> None:
        for due_s, said in link.session.receive(data, self._clock.now()):
            self._schedule(due_s, link, said, is_reply=isinstance(said, bytes))

    def _schedule(self, due_s: float, link: ServedLink, said: bytes | Later, *, is_reply: bool) -> None:
        self._agenda.add(due_s, link, said, is_reply=is_reply)
        link.schedule(said)
        if not isinstance(said, bytes):
            self._waker.call()

    def _send_due(self) -> None:
        """Send all that is due by now, in order."""
        now_s = self._clock.now()
        while (entry := self._agenda.pop(now_s)) is not None:
            if entry.client is not None:
                self._let_say(entry.client, entry)
                continue
            assert not isinstance(entry.said, bytes)
            for due_s, follower in entry.said(entry.due_s):
                self._agenda.add(due_s, None, follower, is_reply=False)

    def _let_say(self, link: ServedLink, entry: Entry[ServedLink | None]) -> None:
        link.schedule(entry.said, -1)
        if isinstance(entry.said, bytes):
            self._clients.say(link, entry.said, is_reply=entry.is_reply)
            return
        link.has_ended |= entry.said is hang_up
        for due_s, follower in self._told(link, entry.said, entry.due_s):
            if isinstance(follower, bytes) and due_s <= entry.due_s:
                # before what was entered later for the same time
                self._clients.say(link, follower, is_reply=False)
            else:
                self._schedule(due_s, link, follower, is_reply=False)
        # one that had too much before it may be listened to again
        self._clients.watch(link)

    def _told(self, link: ServedLink, said: Later, due_s: float) -> Sequence[Due]:
        """What is said at its time, or what may follow when it is too late for it."""
        if isinstance(said, Passing):
            now_s = self._clock.now()
            if link.is_behind or now_s > due_s + said.patience_s:
                return said.passed(now_s)
        return said(due_s)
