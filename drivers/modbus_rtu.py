"""A device on Modbus RTU, over a serial port or over TCP, whose items are 32-bit numbers in two registers."""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable, Sequence
from urllib.parse import urlsplit

from pymodbus import FramerType, ModbusException
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusIOException
from pymodbus.pdu import ModbusPDU

from drivers.reply_text import unusable
from goniometer.errors import DeviceFaultError, NotConnectedError, ReplyTimeoutError

# pymodbus logs what it also raises, and Python prints that when no handler is set.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())

_EXCEPTIONS = {1: "illegal function", 2: "illegal address", 3: "illegal value", 4: "device failure"}


class ModbusRtu:
    """A link to one unit.

    Parameters
    ----------
    port : str
        ``socket://host:port`` or a serial port.
    device : str
        Name of the device, for messages.
    unit : int
        Unit number on the bus.
    baudrate : int
        Bits per second; without effect on a socket.
    parity : str
        ``"E"`` even, ``"O"`` odd or ``"N"`` none; without effect on a socket.
    reply_timeout_s : float
        Longest wait for one answer, in real seconds.
    """

    def __init__(
        self, port: str, *, device: str, unit: int, baudrate: int, parity: str, reply_timeout_s: float
    ) -> None:
        self._port, self._device, self._unit = port, device, unit
        self._unanswered = False
        self._client: ModbusTcpClient | ModbusSerialClient
        # no retries: pymodbus would repeat a write whose answer was lost, and so a motion
        if port.startswith("socket://"):
            try:
                host, tcp_port = urlsplit(port).hostname, urlsplit(port).port
            except ValueError:
                host = tcp_port = None
            if host is None or tcp_port is None:
                raise self._cannot_open()
            self._client = ModbusTcpClient(
                host, port=tcp_port, framer=FramerType.RTU, timeout=reply_timeout_s, retries=0
            )
        else:
            self._client = ModbusSerialClient(
                port, framer=FramerType.RTU, baudrate=baudrate, parity=parity, timeout=reply_timeout_s, retries=0
            )

    def open(self) -> None:
        """Open the port unless it is open; raises NotConnectedError."""
        if self._client.connected:
            return
        if not self._client.connect():
            raise self._cannot_open()
        self._unanswered = False
        if isinstance(self._client.socket, socket.socket):
            try:
                self._client.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            except OSError as error:
                self.close()
                raise self._cannot_open() from error

    def reopen(self) -> None:
        """Close the port and open it again, once; raises NotConnectedError."""
        self.close()
        self.open()

    def read_int32(self, address: int, count: int = 1) -> list[int]:
        """Read `count` signed 32-bit items from `address` on."""
        response = self._exchange(
            3,
            f"read of 0x{address:04X}",
            lambda: self._client.read_holding_registers(address, count=2 * count, device_id=self._unit),
        )
        words = response.registers
        if len(words) != 2 * count:
            self._unanswered = True
            raise unusable(self._device, f"read of 0x{address:04X}", str(words), f"{2 * count} registers")
        items = (high << 16 | low for high, low in zip(words[::2], words[1::2], strict=True))
        return [item - (1 << 32) if item >= 1 << 31 else item for item in items]

    def write_int32(self, address: int, items: Sequence[int]) -> None:
        """Write signed 32-bit items from `address` on, all in one message."""
        words = [word for item in items for word in (item >> 16 & 0xFFFF, item & 0xFFFF)]
        request = f"write to 0x{address:04X}"
        response = self._exchange(
            16, request, lambda: self._client.write_registers(address, words, device_id=self._unit)
        )
        self._check_echo(
            request,
            f"{response.count} registers from 0x{response.address:04X}",
            f"{len(words)} registers from 0x{address:04X}",
        )

    def write_register(self, address: int, word: int) -> None:
        """Write one 16-bit register."""
        request = f"write to 0x{address:04X}"
        response = self._exchange(6, request, lambda: self._client.write_register(address, word, device_id=self._unit))
        self._check_echo(
            request, f"0x{response.registers[0]:04X} at 0x{response.address:04X}", f"0x{word:04X} at 0x{address:04X}"
        )

    def close(self) -> None:
        """Close the port; may be called again."""
        self._client.close()  # type: ignore[no-untyped-call]  # pymodbus leaves it without types

    def _check_echo(self, request: str, echoed: str, sent: str) -> None:
        if echoed != sent:
            self._unanswered = True
            raise unusable(self._device, request, echoed, sent)

    def _exchange(self, function: int, request: str, send: Callable[[], ModbusPDU]) -> ModbusPDU:
        if self._unanswered:
            self.close()  # a late answer to a request that was given up must not be taken for the next one
        self.open()
        self._unanswered = True
        try:
            response = send()
        except ModbusIOException as error:
            raise ReplyTimeoutError(
                self._device,
                f"no valid answer to the {request} of unit {self._unit} on port {self._port}",
                not_done="the exchange was given up; the drive may still carry out its last command",
                to_do="look at the drive first; check that it is on, its unit number, baud rate and wiring",
            ) from error
        except (ModbusException, OSError) as error:
            raise NotConnectedError(
                self._device,
                f"the link on port {self._port} was lost during the {request} ({error})",
                not_done="the exchange was given up; the drive may still carry out its last command",
                to_do="look at the drive first, then check power and cable and start again",
            ) from error
        if response.isError():
            self._unanswered = False
            code = response.exception_code
            raise DeviceFaultError(
                self._device,
                f"the drive refused the {request} with exception {code}, {_EXCEPTIONS.get(code, 'unknown')}",
                not_done="the request was not carried out",
                to_do="check that the device is of the family named in the rig file",
            )
        if response.function_code != function:
            raise unusable(self._device, request, f"function {response.function_code}", f"function {function}")
        self._unanswered = False
        return response

    def _cannot_open(self) -> NotConnectedError:
        return NotConnectedError(
            self._device,
            f"port {self._port} cannot be opened",
            not_done="nothing was sent to the device",
            to_do="check power and cable, close other programs that use the port, and compare the port in the rig file "
            "with the ports of this computer",
        )
