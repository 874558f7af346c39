"""Questions to an HTTP server over a link that may have to be opened afresh for each."""

from __future__ import annotations

from drivers.camera.http_exchange import HttpExchange, HttpResponse
from drivers.wire.link import Link
from goniometer.errors import DeviceError, NotConnectedError, ReplyError

_MOST_AT_ONCE = 1 << 20
"""Bytes taken in one look: a picture comes in several, and other devices are asked in between."""


class HttpDialogue:
    """One question at a time; nothing waits.

    Parameters
    ----------
    link : Link
        A TCP connection.
    name : str
        The device's name in the rig file.
    most_bytes : int
        Longest answer that is taken.
    """

    def __init__(self, link: Link, *, name: str, most_bytes: int) -> None:
        self._link, self._name, self._most_bytes = link, name, most_bytes
        self._response: HttpResponse | None = None
        self._broken: DeviceError | None = None
        self._begin()
        link.on_reopen(self._begin)

    def ask(self, path: str) -> None:
        """Ask for a path. A server may hang up between two questions; what is unfinished is given up likewise.

        Raises
        ------
        NotConnectedError
            When the connection cannot be opened afresh.
        """
        if not self._can_ask():
            self._link.reconnect()
        self._response = self._broken = None
        self._link.write(self._exchange.request(path))

    def has_begun(self) -> bool:
        """Whether anything has come of the answer, or nothing will come any more."""
        self._listen()
        return self._exchange.has_begun or self._broken is not None

    def is_whole(self) -> bool:
        """Whether the answer has come to its end."""
        self._listen()
        return self._response is not None

    def poll(self) -> HttpResponse | None:
        """Return the answer if it has come.

        Raises
        ------
        ReplyError
            When it is broken or does not end.
        NotConnectedError
            When the link has gone before any of it came.
        """
        self._listen()
        if self._broken is not None:
            raise self._broken
        return self._response

    def _listen(self) -> None:
        came = 0
        while self._response is None and self._broken is None and came < _MOST_AT_ONCE:
            try:
                data = self._link.poll(_take_all)
            except NotConnectedError as gone:
                if not self._exchange.has_begun:
                    self._broken = gone
                    return
                data = b""  # it may have been the end of an answer of unknown length
            if data is None:
                return
            came += len(data)
            try:
                self._response = self._exchange.receive(data)
            except ReplyError as error:
                self._broken = error

    def _can_ask(self) -> bool:
        try:
            return self._exchange.can_ask and not self._link.has_input()
        except NotConnectedError:
            return False

    def _begin(self) -> None:
        host = self._link.port.partition("://")[2]
        self._exchange = HttpExchange(self._name, host, self._most_bytes)
        self._response = self._broken = None


def _take_all(received: bytearray) -> bytes:
    data = bytes(received)
    received.clear()
    return data
