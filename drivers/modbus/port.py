"""A port with Modbus units on it: RTU on a serial line or over TCP, or Modbus TCP."""

from __future__ import annotations

import time
from functools import partial

from drivers.modbus.frames import Framing, RtuFraming, TcpFraming
from drivers.wire.link import Link
from drivers.wire.ports import TCP_SCHEMES
from drivers.wire.wire_log import WireLog

_MODBUS_TCP = "modbus-tcp://"
_CHARACTER_BITS = 11
_LAST_TIMED_BAUDRATE = 19200  # above it the pause is always the same


class ModbusPort:
    """One port, shared by the units on it; opened when the first of them asks for it.

    Parameters
    ----------
    address : str
        ``modbus-tcp://host:502``, ``socket://host:port`` for RTU over TCP, or a serial port for RTU.
    device : str
        Name of the line, for messages about the port alone.
    baudrate : int
        Bits per second; without effect over TCP.
    parity : str
        ``"E"`` even, ``"O"`` odd or ``"N"`` none; without effect over TCP.
    reply_timeout_s : float
        Longest wait for one answer, in real seconds.
    wire_log : WireLog, optional
        Where every byte is written down; nowhere when not given.
    """

    def __init__(
        self,
        address: str,
        *,
        device: str,
        baudrate: int = 115200,
        parity: str = "E",
        reply_timeout_s: float = 1.0,
        wire_log: WireLog | None = None,
    ) -> None:
        self.address = address
        self.framing: Framing = TcpFraming() if address.startswith(_MODBUS_TCP) else RtuFraming()
        self._open_link = partial(
            Link,
            address,
            device=device,
            baudrate=baudrate,
            parity=parity,
            reply_timeout_s=reply_timeout_s,
            wire_log=wire_log,
        )
        self._link: Link | None = None
        pause_s = 3.5 * _CHARACTER_BITS / min(baudrate, _LAST_TIMED_BAUDRATE)
        self._pause_s = 0.0 if address.startswith(TCP_SCHEMES) else pause_s
        self._rests_until_s = 0.0

    def link(self) -> Link:
        """Return the link, opened now unless it was opened before; raises NotConnectedError."""
        if self._link is None:
            self._link = self._open_link()
        return self._link

    def rest(self) -> None:
        """Begin the silence of 3.5 characters that ends a frame; a TCP connection needs none."""
        self._rests_until_s = time.monotonic() + self._pause_s

    def wait_until_rested(self) -> None:
        """Wait, in real time, until the line has been silent for long enough for the next frame."""
        left_s = self._rests_until_s - time.monotonic()
        if left_s > 0:
            self.link().discard_input(quiet_s=left_s)

    def close(self) -> None:
        """Close the port for all its units; may be called again."""
        if self._link is not None:
            self._link.close()
