"""The two kinds of ports at which a simulated device is reached: a TCP connection and a pseudo-terminal."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from typing import Protocol

_CHUNK = 4096


class Port(Protocol):
    """Where bytes of one client come and go, without ever waiting."""

    def fileno(self) -> int:
        """For a selector."""
        ...

    def read(self) -> bytes | None:
        """What has come, ``b""`` when nothing has, None when the client is gone."""
        ...

    def write(self, data: bytes) -> int:
        """How many bytes have been taken; ConnectionError when the client is gone."""
        ...

    def close(self) -> None:
        """Give the port back."""
        ...


class SocketPort:
    """One client's TCP connection."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connection = connection

    def fileno(self) -> int:
        """For a selector."""
        return self._connection.fileno()

    def read(self) -> bytes | None:
        """What has come, ``b""`` when nothing has, None when the client is gone."""
        try:
            return self._connection.recv(_CHUNK) or None
        except BlockingIOError:
            return b""
        except ConnectionError:
            return None

    def write(self, data: bytes) -> int:
        """How many bytes the system has taken; ConnectionError when the client is gone."""
        try:
            return self._connection.send(data)
        except BlockingIOError:
            return 0

    def hang_up(self) -> None:
        """Let the client know at once that nothing more will come; the port is still to be closed."""
        with suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


class PtyPort:
    """A pseudo-terminal, there for one client after the other, as a serial port is.

    Raises
    ------
    OSError
        If the system has none to give.
    """

    def __init__(self) -> None:
        # not part of Windows
        import tty

        # the bench keeps the client's side open too, so that the port outlives every client
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)

    def fileno(self) -> int:
        """For a selector."""
        return self._master

    def read(self) -> bytes | None:
        """What has come, ``b""`` when nothing has."""
        try:
            return os.read(self._master, _CHUNK)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """How many bytes the terminal has taken."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Close both sides."""
        os.close(self._master)
        os.close(self._slave)
