"""Modbus TCP: the same units behind a gateway, each request in a frame with a number of its own and no checksum."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator

from sim_devices.device import Replies
from sim_devices.modbus.functions import BROADCAST, Unit
from sim_devices.modbus.rtu import exchange_s

_HEADER = struct.Struct(">HHHB")
_COUNTED_FROM = 6
_LENGTHS = range(2, 255)
_NO_ANSWER = 0x0B
_WAITS_S = 1.0
"""How long the gateway waits for a unit that does not answer."""


class ModbusTcp:
    """A gateway with its units on the serial line behind it.

    Parameters
    ----------
    units : iterable of Unit
        They obey their own address, and all of them address 0, without an answer; for any other address, and for a
        unit that is off, the gateway answers with exception 0B.
    """

    def __init__(self, units: Iterable[Unit]) -> None:
        self._units = {unit.unit: unit for unit in units}
        self._off_until_s: dict[int, float] = {}
        self._free_s = float("-inf")

    @classmethod
    def joined(cls, gateways: Iterable[ModbusTcp]) -> ModbusTcp:
        """One gateway to the units of several."""
        return cls(unit for gateway in gateways for unit in gateway.units)

    @property
    def units(self) -> tuple[Unit, ...]:
        """The units on its line."""
        return tuple(self._units.values())

    def turn_off(self, member: object, until_s: float) -> None:
        """Let one of its units hear and say nothing until then."""
        self._off_until_s |= {number: until_s for number, unit in self._units.items() if unit is member}

    def session(self) -> _Session:
        """A new client."""
        return _Session(self)

    def exchange(self, unit: int, request: bytes, now_s: float) -> tuple[float, bytes] | None:
        """Run a request; its answer with the time at which it is there, or None when there is none."""
        if unit == BROADCAST:
            for number, listener in self._units.items():
                if self._is_on(number, now_s):
                    listener.answer(request, now_s)
            return None
        unanswered = bytes([request[0] | 0x80, _NO_ANSWER])
        if unit not in self._units:
            return now_s, unanswered
        if not self._is_on(unit, now_s):
            self._free_s = max(now_s, self._free_s) + _WAITS_S
            return self._free_s, unanswered
        addressed = self._units[unit]
        answer = addressed.answer(request, now_s)
        # one line serves all clients, one after the other
        self._free_s = max(now_s, self._free_s) + exchange_s(addressed, request, answer)
        return self._free_s, answer

    def _is_on(self, unit: int, now_s: float) -> bool:
        return now_s >= self._off_until_s.get(unit, now_s)


class _Session:
    def __init__(self, gateway: ModbusTcp) -> None:
        self._gateway = gateway
        self._buffer = b""

    def receive(self, data: bytes, now_s: float) -> Replies:
        """Answer every request that is complete."""
        self._buffer += data
        replies: Replies = []
        for transaction, unit, request in self._requests():
            reply = self._gateway.exchange(unit, request, now_s)
            if reply is not None:
                due_s, answer = reply
                replies.append((due_s, _HEADER.pack(transaction, 0, len(answer) + 1, unit) + answer))
        return replies

    def _requests(self) -> Iterator[tuple[int, int, bytes]]:
        """Cut what is complete out of what has arrived: number, unit and request."""
        start = 0
        while len(self._buffer) >= start + _HEADER.size:
            transaction, protocol, length, unit = _HEADER.unpack_from(self._buffer, start)
            if protocol != 0 or length not in _LENGTHS:
                # nothing tells where the next frame begins
                start = len(self._buffer)
                break
            end = start + _COUNTED_FROM + length
            if len(self._buffer) < end:
                break
            yield transaction, unit, self._buffer[start + _HEADER.size : end]
            start = end
        self._buffer = self._buffer[start:]
