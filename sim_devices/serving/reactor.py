"""The one loop that serves every port of a bench: takes bytes, asks the device, sends replies when they are due."""

from __future__ import annotations

import selectors
import socket
import threading
import time
from collections.abc import Callable
from typing import TypeAlias

from goniometer.errors import DeviceFaultError
from sim_devices.device import Device, Later, Session
from sim_devices.serving.agenda import Agenda
from sim_devices.serving.clock import BenchClock
from sim_devices.serving.ports import Port, PtyPort, SocketPort
from sim_devices.serving.served_link import ServedLink
from sim_devices.serving.waker import Waker

# virtual time does not tell when it has passed what a device will say on its own; real seconds from look to look
_LOOK_S = 0.001

# how long, in real seconds, virtual time waits for clients before it goes to what a device will tell one on its own:
# longer than a program that speaks to several devices is silent between two of them
_PATIENCE_S = 0.25

# what stands between a device's session and its client, or None where the client is refused
Between: TypeAlias = Callable[[Session], Session | None]


class Reactor:
    """Serves its ports in a thread of its own, and in any thread that calls `serve`; only one of them at a time.

    Parameters
    ----------
    clock : BenchClock
        Tells when a reply is due. Virtual time goes there as soon as no client has anything more to say; to what a
        device will say on its own it comes when somebody waits or is answered, or when nobody stirs for a while.
    """

    def __init__(self, clock: BenchClock) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        # the default, epoll, waits whole milliseconds, which on a clock 40 times as fast are 40 of the bench's
        self._selector = selectors.SelectSelector()
        self._links: set[ServedLink] = set()
        self._listeners: list[socket.socket] = []
        self._gone: list[Port] = []
        self._agenda: Agenda[ServedLink | None] = Agenda()
        self._between: dict[Device, Between] = {}
        self._failure: BaseException | None = None
        self._is_stopping = False
        self._stirred_s = time.monotonic()
        self._waker = Waker()
        self._selector.register(self._waker, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name="simulated bench", daemon=True)

    def listen(self, device: Device) -> int:
        """Serve a device's clients at a free loopback port; returns its number."""
        listener = socket.create_server(("127.0.0.1", 0), backlog=32)
        listener.setblocking(False)
        with self._lock:
            self._listeners.append(listener)
            self._selector.register(listener, selectors.EVENT_READ, lambda _: self._accept(listener, device))
            self._wake()
        return int(listener.getsockname()[1])

    def open_pty(self, device: Device) -> str:
        """Serve a device's clients at a pseudo-terminal; returns its path.

        Raises
        ------
        OSError
            If the system has none to give.
        """
        port = PtyPort()
        with self._lock:
            self._add(port, device)
        return port.path

    def stand_between(self, device: Device, between: Between) -> None:
        """Have something stand between a device and its clients, those that it has and those to come."""
        with self._lock:
            self._between[device] = between
            for link in self._links_of(device):
                link.session = between(link.session) or link.session

    def at(self, time_s: float, act: Later) -> None:
        """Let something happen to the bench itself, in its turn among all that is said; what follows is no bytes."""
        with self._lock:
            self._agenda.add(time_s, None, act, is_reply=False)
            self._wake()

    def say(self, device: Device, data: bytes) -> None:
        """Let all clients of a device hear something now."""
        with self._lock:
            for link in self._links_of(device):
                self._say(link, data, is_reply=False)

    def cut(self, device: Device, *, hangs_up: bool) -> None:
        """Lose all that is on its way to a device's clients, and their connections too when it hangs up."""
        with self._lock:
            for link in self._links_of(device):
                self._agenda.drop(link)
                link.scheduled_bytes = 0
                link.unsent.clear()
                link.has_ended |= hangs_up and isinstance(link.port, SocketPort)
                self._watch(link)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close every port."""
        self._is_stopping = True
        if self._thread.is_alive():
            self._wake()
            self._thread.join()
        with self._lock:
            self._close_all()
            self._waker.close()

    def serve(self) -> None:
        """Take everything that clients have sent, and answer what is due; raises what stops the bench."""
        with self._lock:
            self.raise_failure()
            if self._is_stopping:
                return
            self._stirred_s = time.monotonic()
            try:
                self._serve()
            except BaseException as failure:
                self._failure = failure
                self._wake()
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
                self._selector.select(self._real_s_until_due())
                with self._lock:
                    # only this thread takes the calls: one taken by another would not have woken it
                    self._waker.hear()
                    self._go_on_when_all_wait()
                    self._serve()
                    self._close_gone()
        except BaseException as failure:  # noqa: BLE001 - kept, and raised by whoever asks next
            self._failure = failure
        finally:
            # a client that waits for a reply should see at once that none will come
            with self._lock:
                self._close_all()

    def _go_on_when_all_wait(self) -> None:
        if (due_s := self._agenda.next_told_s) is None or time.monotonic() < self._stirred_s + _PATIENCE_S:
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
            if events := [(key, mask) for key, mask in self._selector.select(0) if key.data is not None]:
                self._stirred_s = time.monotonic()
                for key, mask in events:
                    key.data(mask)
            elif (due_s := self._agenda.next_reply_s) is None or not self._clock.reach(due_s):
                return

    def _send_due(self) -> None:
        """Send all that is due by now, in order."""
        now_s = self._clock.now()
        while (entry := self._agenda.pop(now_s)) is not None:
            link, said = entry.client, entry.said
            if link is None:
                assert not isinstance(said, bytes)
                for due_s, follower in said(entry.due_s):
                    self._agenda.add(due_s, None, follower, is_reply=False)
                continue
            if isinstance(said, bytes):
                link.scheduled_bytes -= len(said)
                self._say(link, said, is_reply=entry.is_reply)
                continue
            for due_s, follower in said(entry.due_s) if link in self._links else ():
                if isinstance(follower, bytes) and due_s <= entry.due_s:
                    # before what was entered later for the same time
                    self._say(link, follower, is_reply=False)
                else:
                    self._schedule(due_s, link, follower, is_reply=False)

    def _schedule(self, due_s: float, link: ServedLink, said: bytes | Later, *, is_reply: bool) -> None:
        self._agenda.add(due_s, link, said, is_reply=is_reply)
        if isinstance(said, bytes):
            link.scheduled_bytes += len(said)
        else:
            self._wake()

    def _say(self, link: ServedLink, said: bytes, *, is_reply: bool) -> None:
        link.take(said, is_reply=is_reply)
        # a client that is behind is sent more once it has read
        if not link.watched & selectors.EVENT_WRITE:
            self._send(link)

    def _accept(self, listener: socket.socket, device: Device) -> None:
        try:
            connection, _ = listener.accept()
        except (BlockingIOError, ConnectionError):
            # another thread was faster, or the client has gone again
            return
        self._add(SocketPort(connection), device)

    def _add(self, port: Port, device: Device) -> None:
        session = self._between.get(device, _nothing_between)(device.session())
        if session is None:
            port.close()
            return
        link = ServedLink(port, device, session)
        self._links.add(link)
        self._watch(link)

    def _links_of(self, device: Device) -> list[ServedLink]:
        return [link for link in self._links if link.device is device]

    def _attend(self, link: ServedLink, mask: int) -> None:
        if mask & selectors.EVENT_WRITE:
            self._send(link)
        if mask & link.watched & selectors.EVENT_READ:
            self._receive(link)

    def _receive(self, link: ServedLink) -> None:
        data = link.port.read()
        if data is None:
            link.has_ended = True
        else:
            for due_s, said in link.session.receive(data, self._clock.now()) if data else ():
                self._schedule(due_s, link, said, is_reply=isinstance(said, bytes))
        self._watch(link)

    def _send(self, link: ServedLink) -> None:
        try:
            del link.unsent[: link.port.write(bytes(link.unsent))]
        except ConnectionError:
            link.has_ended = True
            link.unsent.clear()
        self._watch(link)

    def _watch(self, link: ServedLink) -> None:
        """Wait for what the link wants now; close it when its client has ended and has been answered."""
        if link not in self._links:
            return
        wanted = link.wanted
        if wanted != link.watched:
            if not link.watched:
                self._selector.register(link.port, wanted, lambda mask: self._attend(link, mask))
            elif not wanted:
                self._selector.unregister(link.port)
            else:
                self._selector.modify(link.port, wanted, self._selector.get_key(link.port).data)
            link.watched = wanted
            self._wake()
        if link.is_done:
            self._links.remove(link)
            self._gone.append(link.port)
            self._wake()

    def _wake(self) -> None:
        """Let the thread look again; nothing to do when it is this one that runs."""
        if threading.current_thread() is not self._thread:
            self._waker.call()

    def _close_gone(self) -> None:
        """Close ports only in the thread that selects: some systems fail when a port is closed meanwhile."""
        while self._gone:
            self._gone.pop().close()

    def _close_all(self) -> None:
        self._gone += (link.port for link in self._links)
        self._links.clear()
        self._close_gone()
        for listener in self._listeners:
            listener.close()
        self._selector.close()


def _nothing_between(session: Session) -> Session:
    """What stands between a device and its clients as long as no fault does."""
    return session
