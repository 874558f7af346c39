"""One serial port, or a serial server reached by TCP, on which a device answers in frames with a fixed ending."""

from __future__ import annotations

import select
import socket
import sys
import time

import serial

from goniometer.errors import NotConnectedError, ReplyError, ReplyTimeoutError

_LONGEST_FRAME = 4096

_PORT_ERRORS: tuple[type[Exception], ...] = (OSError, ValueError)
if sys.platform != "win32":
    import termios

    _PORT_ERRORS += (termios.error,)  # pyserial lets it through


def take_frame(received: bytearray, terminator: bytes) -> bytes | None:
    """Remove the first whole frame from `received` and return it without its terminator; None when more is needed."""
    end = received.find(terminator)
    if end < 0:
        return None
    frame = bytes(received[:end])
    del received[: end + len(terminator)]
    return frame


class Link:
    """An open port.

    Parameters
    ----------
    port : str
        ``COM3``, ``/dev/ttyUSB0``, ``socket://host:port`` or any other address that pyserial opens.
    device : str
        Name of the device at the other end, for messages.
    baudrate : int
        Bits per second; without effect on a socket.
    rtscts : bool
        Whether the device uses RTS/CTS hardware handshake.
    reply_timeout_s : float
        Longest wait for one answer, and for the device to take one command, in real seconds.

    Raises
    ------
    NotConnectedError
        When the port cannot be opened, and from every method once the link is gone.
    """

    def __init__(
        self,
        port: str,
        *,
        device: str,
        baudrate: int = 115200,
        rtscts: bool = False,
        reply_timeout_s: float = 1.0,
    ) -> None:
        self.port, self.device = port, device
        self._baudrate, self._rtscts = baudrate, rtscts
        self._reply_timeout_s = reply_timeout_s
        self._received = bytearray()
        self._last_written = b""
        self._open()

    def reopen(self) -> None:
        """Close the port and open it again, once; raises NotConnectedError."""
        self.close()
        self._received.clear()
        self._open()

    def write(self, data: bytes) -> None:
        """Send `data`; raises ReplyTimeoutError when the device does not take it."""
        self._last_written = data
        if self._socket is not None:
            self._received += self._receive(0.0)  # bytes sent after the other end has hung up vanish without an error
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException as error:
            raise ReplyTimeoutError(
                self.device,
                f"it did not take {data!r} on port {self.port} within {self._reply_timeout_s:g} s",
                not_done="the command may have been sent in part",
                to_do="check that the device is on and that its handshake lines are wired",
            ) from error
        except _PORT_ERRORS as error:
            raise self._lost(error) from error

    def read_until(self, terminator: bytes) -> bytes:
        """Wait for the next frame and return it without its terminator.

        Raises
        ------
        ReplyTimeoutError
            When the frame is not complete within the reply timeout, counted in real time.
        ReplyError
            When the device sends on and on without a terminator.
        """
        deadline_s = time.monotonic() + self._reply_timeout_s
        expired = False
        while (frame := self._take(terminator)) is None:
            if expired:
                raise ReplyTimeoutError(
                    self.device,
                    f"no complete answer to {self._last_written!r} on port {self.port} within "
                    f"{self._reply_timeout_s:g} s (received so far: {bytes(self._received)!r})",
                    not_done="the exchange was given up",
                    to_do="check that the device is on, that the cable sits and that the baud rates agree",
                )
            left_s = deadline_s - time.monotonic()
            expired = left_s <= 0
            self._received += self._receive(max(left_s, 0.0))
        return frame

    def poll_until(self, terminator: bytes) -> bytes | None:
        """Return the next frame without its terminator if it has come, else None; never waits.

        Raises
        ------
        ReplyError
            When the device sends on and on without a terminator.
        """
        self._received += self._receive(0.0)
        return self._take(terminator)

    def discard_input(self) -> None:
        """Throw away all that has come so far, so that an old answer is not taken for the next one.

        Raises
        ------
        ReplyError
            When the device sends on and on for the reply timeout.
        """
        deadline_s = time.monotonic() + self._reply_timeout_s
        self._received.clear()
        while data := self._receive(0.0):
            if time.monotonic() > deadline_s:
                raise ReplyError(
                    self.device,
                    f"bytes come on port {self.port} without a pause (such as {data[:40]!r})",
                    not_done="nothing was sent to the device",
                    to_do="check that the port belongs to this device and that the baud rates agree",
                )

    def has_input(self) -> bool:
        """Whether anything has come that was not read; never waits."""
        self._received += self._receive(0.0)
        return bool(self._received)

    def close(self) -> None:
        """Close the port; may be called again."""
        if self._socket is None:
            self._serial.close()
        else:
            # pyserial sleeps 0.3 s when it closes a socket itself
            self._socket.close()
            self._serial.is_open = False

    def _open(self) -> None:
        try:
            self._serial = serial.serial_for_url(
                self.port,
                baudrate=self._baudrate,
                rtscts=self._rtscts,
                timeout=self._reply_timeout_s,
                write_timeout=self._reply_timeout_s,
                exclusive=True,  # two programs on one port would take each other's answers
            )
        except _PORT_ERRORS as error:
            raise NotConnectedError(
                self.device,
                f"port {self.port} cannot be opened ({error})",
                not_done="nothing was sent to the device",
                to_do="check power and cable, close other programs that use the port, and compare the port in the rig "
                "file with the ports of this computer",
            ) from error
        # pyserial leaves Nagle's algorithm on: a command without an answer followed by a query would then wait some
        # 40 ms for the other end's delayed acknowledgement. The socket has no public name in pyserial.
        self._socket: socket.socket | None = getattr(self._serial, "_socket", None)
        if self._socket is not None:
            try:
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            except OSError as error:
                self.close()
                raise self._lost(error) from error
            self._serial.timeout = 0

    def _take(self, terminator: bytes) -> bytes | None:
        frame = take_frame(self._received, terminator)
        if frame is None and len(self._received) > _LONGEST_FRAME:
            beginning = bytes(self._received[:40])
            self._received.clear()
            raise ReplyError(
                self.device,
                f"more than {_LONGEST_FRAME} bytes without an end came on port {self.port} (beginning {beginning!r})",
                not_done="the answer was thrown away",
                to_do="check that the port belongs to this device and that the baud rates agree",
            )
        return frame

    def _receive(self, wait_s: float) -> bytes:
        try:
            if self._socket is None:
                return self._serial.read(self._serial.in_waiting or (1 if wait_s > 0 else 0))
            # a pyserial socket reads either one byte at a time or without waiting: wait here, then take all there is
            select.select([self._socket], [], [], wait_s)
            return self._serial.read(_LONGEST_FRAME)
        except _PORT_ERRORS as error:
            raise self._lost(error) from error

    def _lost(self, error: Exception) -> NotConnectedError:
        return NotConnectedError(
            self.device,
            f"the link on port {self.port} is gone ({error})",
            not_done="the exchange was given up; the device may still carry out its last command",
            to_do="look at the device first, then check power and cable and start again",
        )
