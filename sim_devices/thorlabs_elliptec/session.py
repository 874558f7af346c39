"""A client's conversation with a simulated Elliptec module, at the pace of its line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from sim_devices.device import Due
from sim_devices.serving.baud import SerialLine
from sim_devices.thorlabs_elliptec.module import Said
from sim_devices.thorlabs_elliptec.packets import GIVES_UP_S, Packet, PacketReader

_BAUDRATE = 9600
_LATENCY_S = 0.002
# address, letters, position and end of a line
_POSITION_BYTES = 13


class Module(Protocol):
    """What a conversation needs of the module."""

    @property
    def address(self) -> str:
        """With which its lines begin."""
        ...

    def take(self, packet: Packet, now_s: float) -> list[Said]:
        """Carry out a packet; what the module says of it."""
        ...

    def give_up(self, address: str, now_s: float) -> list[Said]:
        """Hear that a packet to an address has not been finished in time."""
        ...


class ElliptecSession:
    """A conversation; a packet that is not finished in time is dropped.

    Parameters
    ----------
    module : Module
        The module.
    """

    def __init__(self, module: Module) -> None:
        self._module = module
        self._reader = PacketReader()
        self._to_module, self._to_host = SerialLine(_BAUDRATE), SerialLine(_BAUDRATE)
        self._last_s = float("-inf")
        self._is_watched = False

    def receive(self, data: bytes, now_s: float) -> list[Due]:
        """Take one character after the other."""
        due: list[Due] = []
        self._last_s = now_s
        for byte in data:
            heard_s = self._to_module.carry(1, now_s)
            packet = self._reader.take(chr(byte))
            if packet is not None:
                due += self._say(self._module.take(packet, heard_s))
        if self._reader.unfinished and not self._is_watched:
            due.append(self._watch())
        return due

    def _watch(self) -> Due:
        """One look at a time, however many bytes come meanwhile."""
        self._is_watched = True
        return self._last_s + GIVES_UP_S, self._look

    def _look(self, now_s: float) -> list[Due]:
        self._is_watched = False
        if self._reader.unfinished and now_s < self._last_s + GIVES_UP_S:
            return [self._watch()]
        unfinished, self._reader.unfinished = self._reader.unfinished, ""
        return self._say(self._module.give_up(unfinished[0], now_s)) if unfinished else []

    def _say(self, said: list[Said]) -> list[Due]:
        return [self._due(time_s, what) for time_s, what in said]

    def _due(self, time_s: float, said: str | Callable[[float], str | None]) -> Due:
        if isinstance(said, str):
            reply = line(self._module.address, said)
            return self._to_host.carry(len(reply), time_s + _LATENCY_S), reply

        def say(due_s: float) -> list[Due]:
            text = said(time_s)
            return [] if text is None else [(due_s, line(self._module.address, text))]

        return SerialLine(_BAUDRATE).carry(_POSITION_BYTES, time_s + _LATENCY_S), say


def line(address: str, text: str) -> bytes:
    """What a module says, as it goes over the bus."""
    return f"{address}{text}\r\n".encode("ascii")
