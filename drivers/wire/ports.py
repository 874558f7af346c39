"""Where bytes come and go: a serial port, or a TCP connection to a serial server or an instrument."""

from __future__ import annotations

import errno
import io
import os
import select
import socket
import sys
import time
from typing import Protocol
from urllib.parse import urlsplit

import serial

TCP_SCHEMES = ("socket://", "modbus-tcp://", "http://")
_CONNECT_S = 5.0
_MOST_AT_ONCE = 4096
_NOTHING_OPEN = -1
_PSEUDO_TERMINALS = ("/dev/pts/", "/dev/ttys")

PORT_ERRORS: tuple[type[Exception], ...] = (OSError, ValueError)
if sys.platform != "win32":
    import termios

    PORT_ERRORS += (termios.error,)  # pyserial lets it through


class Port(Protocol):
    """What a link needs of a port. Whatever fails raises one of `PORT_ERRORS`."""

    def open(self) -> None:
        """Open it, afresh if it is open."""
        ...

    def send(self, data: bytes) -> None:
        """Send all of `data`; raises TimeoutError when the other end does not take it."""
        ...

    def receive(self, wait_s: float) -> bytes:
        """Return what has come, after waiting up to `wait_s` for a first byte."""
        ...

    def set_rts(self, *, on: bool) -> None:
        """Set the RTS line, where there is one."""
        ...

    def fileno(self) -> int:
        """Return a descriptor that `select` can wait for."""
        ...

    def close(self) -> None:
        """Close it; may be called again."""
        ...


class TcpPort:
    """A TCP connection; `address` is ``scheme://host:port``."""

    def __init__(self, address: str, *, timeout_s: float) -> None:
        self._address, self._timeout_s = address, timeout_s
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Connect, afresh if connected."""
        self.close()
        parts = urlsplit(self._address)
        if parts.hostname is None or parts.port is None:
            raise ValueError("an address has a host and a port number, such as socket://127.0.0.1:4001")
        opened = socket.create_connection((parts.hostname, parts.port), _CONNECT_S)
        try:
            # a command without an answer followed by a query would wait for the other end's delayed acknowledgement
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            opened.setblocking(False)
        except OSError:
            opened.close()
            raise
        self._socket = opened

    def send(self, data: bytes) -> None:
        """Send all of `data`; raises TimeoutError when the other end does not take it."""
        opened, end_s = self._opened(), time.monotonic() + self._timeout_s
        while data:
            try:
                data = data[opened.send(data) :]
            except BlockingIOError:
                if not select.select([], [opened], [], max(end_s - time.monotonic(), 0.0))[1]:
                    raise TimeoutError from None

    def receive(self, wait_s: float) -> bytes:
        """Return what has come, after waiting up to `wait_s` for a first byte."""
        opened = self._opened()
        if not select.select([opened], [], [], wait_s)[0]:
            return b""
        try:
            data = opened.recv(_MOST_AT_ONCE)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError("the other end hung up")
        return data

    def set_rts(self, *, on: bool) -> None:
        """Do nothing: a socket has no such line."""

    def fileno(self) -> int:
        """Return a descriptor that `select` can wait for."""
        return self._opened().fileno()

    def close(self) -> None:
        """Close it; may be called again."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _opened(self) -> socket.socket:
        if self._socket is None:
            raise ValueError("it is closed")
        return self._socket


class SerialPort:
    """A serial port, or any address that pyserial opens."""

    def __init__(self, address: str, *, baudrate: int, parity: str, rtscts: bool, timeout_s: float) -> None:
        self._address, self._timeout_s = address, timeout_s
        self._baudrate, self._parity, self._rtscts = baudrate, parity, rtscts
        self._serial: serial.Serial | None = None
        self._descriptor: int | None = _NOTHING_OPEN

    def open(self) -> None:
        """Open it, afresh if it is open."""
        self.close()
        self._serial = serial.serial_for_url(
            self._address,
            baudrate=self._baudrate,
            parity=serial.PARITY_NONE if _is_pseudo_terminal(self._address) else self._parity,
            rtscts=self._rtscts,
            timeout=self._timeout_s,
            write_timeout=self._timeout_s,
            exclusive=True,  # two programs on one port would take each other's answers
        )
        try:
            self._descriptor = self._serial.fileno()
        except (AttributeError, io.UnsupportedOperation):  # on Windows, and for some addresses of pyserial
            self._descriptor = None

    def send(self, data: bytes) -> None:
        """Send all of `data`; raises TimeoutError when the other end does not take it."""
        try:
            self._opened().write(data)
        except serial.SerialTimeoutException as error:
            raise TimeoutError from error

    def receive(self, wait_s: float) -> bytes:
        """Return what has come, after waiting up to `wait_s` for a first byte."""
        if self._descriptor is None:
            return self._receive_by_pyserial(wait_s)
        # pyserial would read first one byte and then the others, each behind a wait of its own
        if not select.select([self._descriptor], [], [], wait_s)[0]:
            return b""
        data = os.read(self._descriptor, _MOST_AT_ONCE)
        if not data:
            raise ConnectionResetError("the port has gone")
        return data

    def set_rts(self, *, on: bool) -> None:
        """Set the RTS line; without effect on a pseudo-terminal, which has none."""
        try:
            self._opened().rts = on
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTTY):
                raise

    def fileno(self) -> int:
        """Return a descriptor that `select` can wait for."""
        return self._opened().fileno()

    def close(self) -> None:
        """Close it; may be called again."""
        self._descriptor = _NOTHING_OPEN
        if self._serial is not None:
            self._serial.close()
            self._serial = None

    def _receive_by_pyserial(self, wait_s: float) -> bytes:
        opened = self._opened()
        if wait_s > 0 and not opened.in_waiting:
            opened.timeout = wait_s
            return opened.read(1)
        return opened.read(opened.in_waiting)

    def _opened(self) -> serial.Serial:
        if self._serial is None:
            raise ValueError("it is closed")
        return self._serial


def _is_pseudo_terminal(address: str) -> bool:
    """Whether it has no parity, which to ask for is an error when a pseudo-terminal is opened for the second time."""
    return os.path.realpath(address).startswith(_PSEUDO_TERMINALS)
