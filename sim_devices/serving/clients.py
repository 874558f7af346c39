"""The clients of a bench: their ports, whom to listen to, and what has been said to them and not yet been sent."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable
from typing import TypeAlias

from sim_devices.device import Device, Session
from sim_devices.serving.ports import Port, PtyPort, SocketPort
from sim_devices.serving.served_link import ServedLink
from sim_devices.serving.waker import Waker

# far more than any bench has, and few enough for `select`, which watches no more than 512 on some systems
_MOST_CLIENTS = 256

# what stands between a device's session and its client, or None where the client is refused
Between: TypeAlias = Callable[[Session], Session | None]


class Clients:
    """All clients, of whom none makes another wait; but for `wait`, whoever calls it holds the reactor's lock.

    Parameters
    ----------
    hear : callable
        Takes what a client has sent.
    forget : callable
        Told of a client that is gone.
    waker : Waker
        Called when there is something else to wait for.
    """

    def __init__(
        self, hear: Callable[[ServedLink, bytes], None], forget: Callable[[ServedLink], None], waker: Waker
    ) -> None:
        self._hear, self._forget, self._waker = hear, forget, waker
        # the default, epoll, waits whole milliseconds, which on a clock 40 times as fast are 40 of the bench's
        self._selector = selectors.SelectSelector()
        self._selector.register(waker, selectors.EVENT_READ)
        self._links: set[ServedLink] = set()
        self._listeners: list[socket.socket] = []
        self._gone: list[Port] = []
        self._between: dict[Device, Between] = {}

    def listen(self, device: Device) -> int:
        """Take a device's clients at a free loopback port; returns its number."""
        listener = socket.create_server(("127.0.0.1", 0), backlog=32)
        listener.setblocking(False)
        self._listeners.append(listener)
        self._selector.register(listener, selectors.EVENT_READ, lambda _: self._accept(listener, device))
        self._waker.call()
        return int(listener.getsockname()[1])

    def open_pty(self, device: Device) -> str:
        """Take a device's clients at a pseudo-terminal; returns its path. OSError if the system has none to give."""
        port = PtyPort()
        self._add(port, device)
        return port.path

    def stand_between(self, device: Device, between: Between) -> None:
        """Have something stand between a device and its clients, those that it has and those to come."""
        self._between[device] = between
        for link in self.of(device):
            link.session = between(link.session) or link.session

    def of(self, device: Device) -> list[ServedLink]:
        """A device's clients."""
        return [link for link in self._links if link.device is device]

    def wait(self, real_s: float | None) -> None:
        """Wait until a client stirs, or the waker is called; for ever where no time is given."""
        self._selector.select(real_s)

    def attend(self) -> bool:
        """Take what has been sent, and send what waits for it; whether any client has stirred."""
        events = [(key, mask) for key, mask in self._selector.select(0) if key.data is not None]
        for key, mask in events:
            key.data(mask)
        return bool(events)

    def say(self, link: ServedLink, said: bytes, *, is_reply: bool) -> None:
        """Send bytes to a client; one that is behind is sent more once it has read."""
        link.take(said, is_reply=is_reply)
        if not link.watched & selectors.EVENT_WRITE:
            self._send(link)

    def watch(self, link: ServedLink) -> None:
        """Wait for what a client wants now; close it when it has ended and has been answered."""
        if link not in self._links:
            return
        wanted = link.wanted
        if wanted != link.watched:
            if not link.watched:
                self._selector.register(link.port, wanted, lambda mask: self._serve(link, mask))
            elif not wanted:
                self._selector.unregister(link.port)
            else:
                self._selector.modify(link.port, wanted, self._selector.get_key(link.port).data)
            link.watched = wanted
            self._waker.call()
        if link.is_done:
            self._links.remove(link)
            self._forget(link)
            self._gone.append(link.port)
            self._waker.call()

    def close_gone(self) -> None:
        """Close ports only in the thread that waits: some systems fail when a port is closed meanwhile."""
        while self._gone:
            self._gone.pop().close()

    def close(self) -> None:
        """Close every port."""
        self._gone += (link.port for link in self._links)
        self._links.clear()
        self.close_gone()
        for listener in self._listeners:
            listener.close()
        self._selector.close()

    def _accept(self, listener: socket.socket, device: Device) -> None:
        try:
            connection, _ = listener.accept()
        except OSError:
            # another thread was faster, the client has gone again, or the system has no connection left to give
            return
        port = SocketPort(connection)
        if len(self._links) < _MOST_CLIENTS:
            self._add(port, device)
        else:
            port.close()

    def _add(self, port: Port, device: Device) -> None:
        session = self._between.get(device, _nothing_between)(device.session())
        if session is None:
            port.close()
            return
        link = ServedLink(port, device, session)
        self._links.add(link)
        self.watch(link)

    def _serve(self, link: ServedLink, mask: int) -> None:
        if mask & selectors.EVENT_WRITE:
            self._send(link)
        if mask & link.watched & selectors.EVENT_READ:
            self._receive(link)

    def _receive(self, link: ServedLink) -> None:
        data = link.port.read()
        if data is None:
            link.has_ended = True
        elif data:
            self._hear(link, data)
        self.watch(link)

    def _send(self, link: ServedLink) -> None:
        try:
            del link.unsent[: link.port.write(bytes(link.unsent))]
        except ConnectionError:
            link.has_ended = True
            link.unsent.clear()
        self.watch(link)


def _nothing_between(session: Session) -> Session:
    """What stands between a device and its clients as long as no fault does."""
    return session
