"""One Modbus unit, whose coils, inputs and registers are read and written."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from contextlib import suppress
from itertools import cycle

from drivers.modbus.frames import (
    READ_COILS,
    READ_INPUTS,
    READ_REGISTERS,
    REFUSED,
    WRITE_COIL,
    WRITE_REGISTER,
    Request,
    loop_back_request,
    read_request,
    write_registers_request,
    write_request,
)
from drivers.modbus.port import ModbusPort
from drivers.wire.link import Link
from drivers.wire.reply_text import unusable
from goniometer.errors import DeviceFaultError, ReplyTimeoutError

_REFUSALS = {
    1: "illegal function",
    2: "illegal address",
    3: "illegal value",
    4: "device failure",
    5: "accepted, but not done yet",
    6: "busy",
    10: "no way to the device from the gateway",
    11: "no answer from the device behind the gateway",
}
_COIL_ON = 0xFF00


def int32s(words: Sequence[int]) -> list[int]:
    """Read pairs of registers, the high word first, as signed numbers."""
    return list(struct.unpack(f">{len(words) // 2}i", struct.pack(f">{len(words)}H", *words)))


def words_of(int32s: Sequence[int]) -> list[int]:
    """Split signed 32-bit numbers into pairs of registers, the high word first."""
    return list(struct.unpack(f">{2 * len(int32s)}H", struct.pack(f">{len(int32s)}i", *int32s)))


class ModbusUnit:
    """One unit on a port. What reads is repeated when its answer is lost; what writes never is.

    An RTU answer does not say what it answers. After an answer that was none, or never came, one that comes late might
    be taken for the next; before the next read the unit is then asked to return a number never sent before, and all
    that comes earlier is dropped. A write needs no such proof, for its answer repeats it: a stop goes out at once.

    Parameters
    ----------
    port : ModbusPort
        The port, which other units may share.
    number : int
        Unit number on the line, 1 to 247.
    device : str
        Name of the device, for messages and for the wire log.
    """

    def __init__(self, port: ModbusPort, number: int, *, device: str) -> None:
        self._port, self._number, self._device = port, number, device
        self._link: Link | None = None
        self._in_doubt = False
        self._marks = cycle(range(1, 0x10000))

    def open(self) -> Link:
        """Open the port unless it is open; raises NotConnectedError."""
        if self._link is None:
            self._link = self._port.link().for_device(self._device)
            self._link.on_reopen(self._doubt)
        return self._link

    def reopen(self) -> None:
        """Close the port and open it again, once, for all its units; raises NotConnectedError."""
        self.open().reconnect()

    def read_coils(self, address: int, number: int) -> list[bool]:
        """Read coils (function 1)."""
        return _bits(self._read(READ_COILS, address, number), number)

    def read_inputs(self, address: int, number: int) -> list[bool]:
        """Read discrete inputs (function 2)."""
        return _bits(self._read(READ_INPUTS, address, number), number)

    def read_registers(self, address: int, number: int) -> list[int]:
        """Read holding registers (function 3)."""
        return list(struct.unpack(f">{number}H", self._read(READ_REGISTERS, address, number)))

    def read_int32(self, address: int, number: int = 1) -> list[int]:
        """Read signed 32-bit items of two registers each (function 3)."""
        return int32s(self.read_registers(address, 2 * number))

    def write_coil(self, address: int, *, on: bool) -> None:
        """Write one coil (function 5)."""
        self._write(write_request(WRITE_COIL, address, _COIL_ON if on else 0))

    def write_register(self, address: int, word: int) -> None:
        """Write one register (function 6)."""
        self._write(write_request(WRITE_REGISTER, address, word))

    def write_registers(self, address: int, words: Sequence[int]) -> None:
        """Write registers in one message (function 16)."""
        self._write(write_registers_request(address, words))

    def write_int32(self, address: int, items: Sequence[int]) -> None:
        """Write signed 32-bit items of two registers each in one message (function 16)."""
        self.write_registers(address, words_of(items))

    def close(self) -> None:
        """Close the port for all its units; may be called again."""
        self._port.close()

    def _read(self, function: int, address: int, number: int) -> bytes:
        request = read_request(function, address, number)
        return self.open().until_answered(lambda: self._exchange_in_step(request))[2:]

    def _exchange_in_step(self, request: Request) -> bytes:
        self._clear_line()
        if self._in_doubt and not self._port.framing.answers_are_numbered:
            with suppress(DeviceFaultError):  # a unit that knows no loop-back refuses it, which proves as much
                self._exchange(loop_back_request(next(self._marks)))
            self._in_doubt = False
        return self._exchange(request)

    def _write(self, request: Request) -> None:
        self._clear_line()
        self._exchange(request)

    def _clear_line(self) -> None:
        link = self.open()
        if link.has_input():
            link.discard_input()
            self._in_doubt = True

    def _exchange(self, request: Request) -> bytes:
        link = self.open()
        self._port.wait_until_rested()
        was_in_doubt, self._in_doubt = self._in_doubt, True
        link.write(self._port.framing.wrap(self._number, request.message))
        try:
            answer = link.read(lambda received: self._take(received, request, was_in_doubt))
        except ReplyTimeoutError as error:
            raise self._silent(request) from error
        finally:
            self._port.rest()
        if not request.is_answered_by(answer):
            raise unusable(
                self._device,
                request.text,
                answer.hex(" "),
                f"{request.answer_length} bytes that begin with {request.answer_start.hex(' ')}",
            )
        self._in_doubt = was_in_doubt
        if answer[0] & REFUSED:
            raise self._refused(request, answer[1])
        return answer

    def _take(self, received: bytearray, request: Request, was_in_doubt: bool) -> bytes | None:
        while (message := self._port.framing.take(received, self._number)) is not None:
            if request.is_answered_by(message) or not was_in_doubt or self._port.framing.answers_are_numbered:
                return message
        return None

    def _doubt(self) -> None:
        self._in_doubt = True

    def _silent(self, request: Request) -> ReplyTimeoutError:
        return ReplyTimeoutError(
            self._device,
            f"no valid answer to the {request.text} of unit {self._number} on port {self._port.address}",
            not_done="the exchange was given up; the drive may still carry out its last command",
            to_do="look at the drive first; check that it is on, its unit number, baud rate and wiring",
        )

    def _refused(self, request: Request, code: int) -> DeviceFaultError:
        return DeviceFaultError(
            self._device,
            f"the drive refused the {request.text} with exception {code}, {_REFUSALS.get(code, 'unknown')}",
            not_done="the request was not carried out",
            to_do="check that the device is of the family named in the rig file",
        )


def _bits(answer: bytes, number: int) -> list[bool]:
    return [bool(answer[bit // 8] >> bit % 8 & 1) for bit in range(number)]
