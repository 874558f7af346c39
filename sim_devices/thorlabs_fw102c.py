"""A simulated Thorlabs FW102C or FW212C filter wheel: its echo, its prompt and its turns."""

from __future__ import annotations

import re
from collections.abc import Collection

from sim_devices.device import Due, Later
from sim_devices.serving.baud import SerialLine
from sim_devices.wheel import Wheel

_FAST_SLOT_S, _SLOW_SLOT_S = 0.5, 2.0
_LONGEST_COMMAND = 64
_IDENTITY = b"THORLABS FW102C/FW212C Filter Wheel version 1.07\r"
_PROMPT = b"> "
_ESCAPE = 0x1B
_NEXT, _PREVIOUS = b"\x1b[A", b"\x1b[B"
_SETTING = re.compile(r"(pos|pcount|speed|trig|sensors|baud)(\?|=(.*))")


class ThorlabsFw102c:
    """A wheel that works through what it is sent one character after the other.

    A turn keeps it busy: what arrives meanwhile is echoed and run on arrival. It has one input: a client finds what
    another one has left half typed.

    Parameters
    ----------
    wheel : Wheel
        The wheel of the bench.
    slots : collection of int
        Slots all round, 1 to 6 or 1 to 12.
    baudrates : (int, int)
        Of its serial line, as the setting ``baud`` has it.
    """

    def __init__(self, wheel: Wheel, slots: Collection[int], *, baudrates: tuple[int, int] = (9600, 115_200)) -> None:
        self._wheel, self._baudrates = wheel, baudrates
        self._saved = {"pcount": len(slots), "speed": 1, "trig": 0, "sensors": 0, "baud": 1}
        self.inward, self.outward = SerialLine(baudrates[1]), SerialLine(baudrates[1])
        self._wake()

    def _wake(self) -> None:
        self._settings = dict(self._saved)
        self._typed = b""
        self._free_s = 0.0
        self._set_line()

    def _set_line(self) -> None:
        for line in (self.inward, self.outward):
            line.set(self._baudrates[self._settings["baud"]])

    def session(self) -> _Session:
        """A new client."""
        return _Session(self)

    def power_cycle(self, now_s: float) -> None:
        """Forget what was typed and not saved; the wheel stays where its last turn leads."""
        self._wake()

    def press(self, now_s: float) -> None:
        """Press the button that turns the wheel one slot on."""
        self._step(1, self.free_s(now_s))

    def free_s(self, now_s: float) -> float:
        """When a character that arrives now is taken."""
        return max(now_s, self._free_s)

    def take(self, character: int, now_s: float) -> list[Due]:
        """Take one typed character: its echo, or the answer to the command that it ends."""
        if character in b"\0\n":
            return []
        if character == _ESCAPE or self._typed[:1] == b"\x1b":
            self._take_cursor_key(character, now_s)
            return []
        if character != ord("\r"):
            # a command that is too long for the device's memory stays one that it does not know
            self._typed = (self._typed + bytes([character]))[:_LONGEST_COMMAND]
            return [(now_s, bytes([character]))]
        command, self._typed = self._typed.decode("ascii", "replace"), b""
        answer = self._run(command, now_s)
        arrival_s = self.free_s(now_s)
        # nobody waits for the end of a turn alone: virtual time must not hurry there while clients speak to others
        prompt: bytes | Later = _PROMPT if arrival_s == now_s else lambda due_s: [(due_s, _PROMPT)]
        return [(now_s, b"\r" + answer), (arrival_s, prompt)]

    def _take_cursor_key(self, character: int, now_s: float) -> None:
        self._typed = b"\x1b" if character == _ESCAPE else self._typed + bytes([character])
        if self._typed in (_NEXT, _PREVIOUS):
            self._step(1 if self._typed == _NEXT else -1, now_s)
            self._typed = b""
        elif not _NEXT.startswith(self._typed) and not _PREVIOUS.startswith(self._typed):
            self._typed = b""

    def _step(self, direction: int, now_s: float) -> None:
        self._turn((self._wheel.target - 1 + direction) % self._settings["pcount"] + 1, now_s)

    def _run(self, command: str, now_s: float) -> bytes:
        """Run one command and return what comes between echo and prompt; the device is free once it is done."""
        if command == "*idn?":
            return _IDENTITY
        if command == "save":
            self._saved = dict(self._settings)
            return b""
        parts = _SETTING.fullmatch(command)
        if parts is None:
            return b"Command error CMD_NOT_DEFINED\r"
        name, verb, value = parts.groups()
        if verb == "?":
            return f"{self._wheel.target if name == 'pos' else self._settings[name]}\r".encode()
        if not value.isascii() or not value.isdigit() or int(value) not in self._allowed(name):
            return b"Command error CMD_ARG_INVALID\r"
        if name == "pos":
            self._turn(int(value), now_s)
        else:
            self._settings[name] = int(value)
            self._set_line()
        return b""

    def _allowed(self, name: str) -> Collection[int]:
        if name == "pos":
            return range(1, self._settings["pcount"] + 1)
        if name == "pcount":
            # a wheel that stands beyond slot 6 cannot be told that it has six
            return [slots for slots in (6, 12) if slots >= self._wheel.target]
        return (0, 1)

    def _turn(self, slot: int, now_s: float) -> None:
        slot_s = _FAST_SLOT_S if self._settings["speed"] else _SLOW_SLOT_S
        self._free_s = self._wheel.turn(slot, now_s, slots=self._settings["pcount"], slot_s=slot_s)


class _Session:
    def __init__(self, device: ThorlabsFw102c) -> None:
        self._device = device

    def receive(self, data: bytes, now_s: float) -> list[Due]:
        """Echo every character as the device takes it; a carriage return runs the command."""
        device, replies = self._device, list[Due]()
        heard_s = device.inward.carry(len(data), now_s)
        for character in data:
            for due_s, said in device.take(character, device.free_s(heard_s)):
                before = replies[-1][1] if replies and replies[-1][0] == due_s else None
                if isinstance(before, bytes) and isinstance(said, bytes):
                    replies[-1] = due_s, before + said
                else:
                    replies.append((due_s, said))
        turns = any(not isinstance(said, bytes) for _, said in replies)
        return [self._told(due_s, said, turns=turns) for due_s, said in replies]

    def _told(self, due_s: float, said: bytes | Later, *, turns: bool) -> Due:
        """What is said once the line has carried it; nobody waits for the mere echo of a turn either."""
        if not isinstance(said, bytes):
            return due_s, said
        told_s = self._device.outward.carry(len(said), due_s)
        return told_s, (lambda due_s: [(due_s, said)]) if turns else said
