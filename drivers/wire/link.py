"""One port, owned by one object: framing, deadlines, repeats and reconnection for the devices that are on it."""

from __future__ import annotations

import copy
import logging
import math
import time
from collections.abc import Callable
from typing import TypeVar

from drivers.wire import link_errors
from drivers.wire.framing import take_exactly, take_frame
from drivers.wire.ports import PORT_ERRORS, TCP_SCHEMES, Port, SerialPort, TcpPort
from drivers.wire.wire_log import WireLog
from goniometer.errors import DeviceError, ReplyError, ReplyTimeoutError

T = TypeVar("T")
E = TypeVar("E", bound=DeviceError)

_LONGEST_FRAME = 4096
_MOST_ATTEMPTS = 3
_JUST_NOW_S = 1e-3
_log = logging.getLogger(__name__)


class Link:
    """An open port.

    Parameters
    ----------
    port : str
        ``COM3``, ``/dev/ttyUSB0``, ``socket://host:port`` or any other address that pyserial opens.
    device : str
        Name of the device at the other end, for messages and for the wire log.
    baudrate : int
        Bits per second; without effect on a socket.
    parity : str
        ``"N"`` none, ``"E"`` even or ``"O"`` odd; without effect on a socket.
    rtscts : bool
        Whether the device uses RTS/CTS hardware handshake.
    reply_timeout_s : float
        Longest wait for one answer, and for the device to take one command, in real seconds.
    wire_log : WireLog, optional
        Where every byte is written down; nowhere when not given.
    most_logged : int, optional
        How many bytes of what comes behind one command are written down at most: a picture would fill the log. All when
        not given.

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
        parity: str = "N",
        rtscts: bool = False,
        reply_timeout_s: float = 1.0,
        wire_log: WireLog | None = None,
        most_logged: int | None = None,
    ) -> None:
        self.port, self.device = port, device
        self._is_socket = port.startswith(TCP_SCHEMES)
        self._port: Port = (
            TcpPort(port, timeout_s=reply_timeout_s)
            if self._is_socket
            else SerialPort(port, baudrate=baudrate, parity=parity, rtscts=rtscts, timeout_s=reply_timeout_s)
        )
        self._reply_timeout_s = reply_timeout_s
        self._wire_log, self._most_logged, self._came = wire_log, most_logged, 0
        self._received = bytearray()
        self._last_written = b""
        self._looked_s = -math.inf
        self._on_reopen: list[Callable[[], None]] = []
        self._open()

    def for_device(self, device: str) -> Link:
        """Return the same port under the name of another device on it."""
        link = copy.copy(self)
        link.device = device
        return link

    def write(self, data: bytes) -> None:
        """Send `data`; raises ReplyTimeoutError when the device does not take it."""
        self._last_written = data
        if self._is_socket and time.monotonic() - self._looked_s > _JUST_NOW_S:
            self._received += self._receive(0.0)  # bytes sent after the other end has hung up vanish without an error
        if self._wire_log is not None:
            self._log_rest(self._wire_log)
            self._wire_log.sent(self.device, data)
        try:
            self._port.send(data)
        except TimeoutError as error:
            raise self._noted(link_errors.not_taken(self.device, self.port, data, self._reply_timeout_s)) from error
        except PORT_ERRORS as error:
            raise self._noted(link_errors.lost(self.device, self.port, error)) from error

    def read(self, take: Callable[[bytearray], T | None], timeout_s: float | None = None) -> T:
        """Wait for the next frame.

        Parameters
        ----------
        take : callable
            Removes the first whole frame from the bytes received and returns it; None, and nothing removed that
            belongs to a frame, when more is needed.
        timeout_s : float, optional
            Longest wait in real seconds, however slowly bytes drip in; the link's reply timeout when not given.

        Raises
        ------
        ReplyTimeoutError
            When the frame is not complete in time.
        ReplyError
            When the device sends on and on without a frame.
        """
        limit_s = left_s = self._reply_timeout_s if timeout_s is None else timeout_s
        end_s = time.monotonic() + limit_s
        while (frame := self._take(take)) is None:
            if left_s <= 0:
                asked, received = self._last_written, bytes(self._received)
                raise self._noted(link_errors.unanswered(self.device, self.port, asked, limit_s, received))
            left_s = end_s - time.monotonic()
            self._received += self._receive(max(left_s, 0.0))
        return frame

    def poll(self, take: Callable[[bytearray], T | None]) -> T | None:
        """Return the next frame if it has come, else None; never waits. Raises ReplyError as `read` does."""
        self._received += self._receive(0.0)
        return self._take(take)

    def read_until(self, terminator: bytes, timeout_s: float | None = None) -> bytes:
        """Wait for the next frame, as `read` does, and return it without its terminator."""
        return self.read(lambda received: take_frame(received, terminator), timeout_s)

    def read_exactly(self, length: int, timeout_s: float | None = None) -> bytes:
        """Wait for the next `length` bytes, as `read` does."""
        return self.read(lambda received: take_exactly(received, length), timeout_s)

    def poll_until(self, terminator: bytes) -> bytes | None:
        """Return the next frame without its terminator if it has come, as `poll` does."""
        return self.poll(lambda received: take_frame(received, terminator))

    def has_input(self) -> bool:
        """Whether anything has come that was not read; never waits."""
        self._received += self._receive(0.0)
        self._looked_s = time.monotonic()
        return bool(self._received)

    def has_frame(self, terminator: bytes) -> bool:
        """Whether a whole frame has come that was not read; never waits, and reads none."""
        self._received += self._receive(0.0)
        return terminator in self._received

    def discard_input(self, quiet_s: float = 0.0) -> None:
        """Throw away all that has come, until nothing comes for `quiet_s` real seconds.

        Raises
        ------
        ReplyError
            When the device sends on and on for the reply timeout.
        """
        end_s = time.monotonic() + self._reply_timeout_s
        self._received.clear()
        while data := self._receive(quiet_s):
            if time.monotonic() > end_s:
                raise self._noted(link_errors.restless(self.device, self.port, data[:40]))

    def until_answered(self, exchange: Callable[[], T]) -> T:
        """Do an exchange that is safe to repeat, up to three times until it is answered; never for a motion.

        Raises
        ------
        ReplyTimeoutError, ReplyError
            From the third attempt.
        """
        for attempt in range(1, _MOST_ATTEMPTS):
            try:
                return exchange()
            except (ReplyTimeoutError, ReplyError) as error:
                self._note(f"attempt {attempt} failed and is repeated: {error.happened}")
        return exchange()

    def reconnect(self) -> None:
        """Close the port and open it again, once; raises NotConnectedError. How often, is for those to say who wait."""
        self.close()
        self._received.clear()
        self._looked_s = -math.inf
        self._open()
        for forget in self._on_reopen:
            forget()

    def on_reopen(self, forget: Callable[[], None]) -> None:
        """Have `forget` called whenever the port was opened afresh, by whichever of its devices.

        It sends nothing: it notes that answers still to come will not come, and that what was known of the device, such
        as its position, has to be asked for again.
        """
        self._on_reopen.append(forget)

    def set_rts(self, *, on: bool) -> None:
        """Set the RTS line; without effect on ports that have none, such as sockets."""
        try:
            self._port.set_rts(on=on)
        except PORT_ERRORS as error:
            raise self._noted(link_errors.lost(self.device, self.port, error)) from error

    def fileno(self) -> int:
        """Return a descriptor that `select` can wait for."""
        return self._port.fileno()

    def close(self) -> None:
        """Close the port; may be called again."""
        self._port.close()

    def _open(self) -> None:
        try:
            self._port.open()
        except PORT_ERRORS as error:
            raise self._noted(link_errors.cannot_open(self.device, self.port, error)) from error
        self._log(f"port {self.port} is open")

    def _take(self, take: Callable[[bytearray], T | None]) -> T | None:
        frame = take(self._received) if self._received else None
        if frame is None and len(self._received) > _LONGEST_FRAME:
            beginning = bytes(self._received[:40])
            self._received.clear()
            raise self._noted(link_errors.endless(self.device, self.port, _LONGEST_FRAME, beginning))
        return frame

    def _receive(self, wait_s: float) -> bytes:
        try:
            data = self._port.receive(wait_s)
        except PORT_ERRORS as error:
            raise self._noted(link_errors.lost(self.device, self.port, error)) from error
        if data and self._wire_log is not None:
            self._log_received(self._wire_log, data)
        return data

    def _log_received(self, wire_log: WireLog, data: bytes) -> None:
        room = len(data) if self._most_logged is None else max(0, self._most_logged - self._came)
        self._came += len(data)
        if room:
            wire_log.received(self.device, data[:room])

    def _log_rest(self, wire_log: WireLog) -> None:
        if self._most_logged is not None and self._came > self._most_logged:
            wire_log.event(self.device, f"{self._came - self._most_logged} more bytes came and are not written here")
        self._came = 0

    def _note(self, event: str) -> None:
        _log.warning("%s: %s", self.device, event)
        self._log(event)

    def _noted(self, error: E) -> E:
        """Write an error of the link down on its way to whoever asked."""
        self._log(error.happened)
        return error

    def _log(self, event: str) -> None:
        if self._wire_log is not None:
            self._wire_log.event(self.device, event)
