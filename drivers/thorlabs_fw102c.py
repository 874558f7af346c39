"""Thorlabs FW102C and FW212C filter wheels as analyzers: every command is echoed, every answer ends in a prompt."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeVar

from drivers.clock import Clock, Deadline
from drivers.wire.link import Link
from drivers.wire.reply_text import unusable, whole_number
from goniometer.errors import DeviceFaultError, LimitError, PositionError, ReplyError, ReplyTimeoutError

T = TypeVar("T")

_PROMPT = b"> "
_POLL_S = 0.01


@dataclass(frozen=True)
class Exchange:
    """A command as the wheel echoed it, and what it answered (empty for a command that only acts)."""

    echo: str
    answer: str


def parse_exchange(frame: bytes) -> Exchange:
    """Split what came before a prompt into echo and answer; zero bytes after power-up are dropped."""
    echo, _, answer = frame.replace(b"\x00", b"").decode("ascii", errors="replace").partition("\r")
    return Exchange(echo.strip(), answer.strip())


class ThorlabsFw102c:
    """A filter wheel that holds polarizers.

    Parameters
    ----------
    link : Link
        115200 baud, no handshake.
    clock : Clock
        Counts the deadline of a motion.
    name : str
        The device's name in the rig file.
    slots : int
        How many slots the wheel has: 6 or 12.
    slot_s : float
        Time from one slot to its neighbour, for planning a scan.
    settle_s : float
        Time for the wheel to come to rest after its prompt.
    """

    def __init__(self, link: Link, clock: Clock, *, name: str, slots: int = 6, slot_s: float, settle_s: float) -> None:
        self.name, self.slots, self.slot_s, self.settle_s = name, slots, slot_s, settle_s
        self._link = link
        self._clock = clock
        self._in_step = True  # nothing was asked yet; `connect` proves it
        self._marks = 0
        self._target: int | None = None
        self._seen: int | None = None
        self._arrives_s = math.inf
        self._deadline = Deadline(clock, 0.0)

    def connect(self) -> tuple[str, ...]:
        """Check that a wheel answers and how many slots it has, and switch its sensors off at rest; moves nothing.

        Returns
        -------
        tuple of str
            Nothing: a wheel keeps no errors.

        Raises
        ------
        ReplyError
            When another device answers.
        DeviceFaultError
            When the wheel has another number of slots than the rig file says.
        """
        self._in_step = False
        self._query("*idn?", _identity)
        slots = self._query("pcount?", whole_number)
        if slots != self.slots:
            raise DeviceFaultError(
                self.name,
                f"the wheel is set up for {slots} slots, the rig file for {self.slots}",
                not_done="the wheel was not moved",
                to_do="correct the slots in the rig file, or the wheel's own setting (pcount)",
            )
        self._query("sensors=0", _nothing)  # their light would be seen in every reading
        return ()

    def start_select(self, slot: int) -> None:
        """Begin to bring a slot into the beam; raises LimitError, with nothing sent, for a slot the wheel has not."""
        if not 1 <= slot <= self.slots:
            raise LimitError(
                self.name,
                f"slot {slot} does not exist; the wheel has slots 1 to {self.slots}",
                not_done="the move was refused and nothing was sent",
                to_do="correct the slot in the rig file",
            )
        apart = self.slots if self._seen is None else abs(slot - self._seen)
        self._arrives_s = self._clock.now() + min(apart, self.slots - apart) * self.slot_s
        self._write(f"pos={slot}")
        self._target = slot
        self._deadline = Deadline(self._clock, self._longest_motion_s)

    def is_moving(self) -> bool:
        """Whether the slot is still on its way.

        Raises
        ------
        ReplyTimeoutError
            When the wheel has not arrived within 1 s and 4 s a slot.
        DeviceFaultError
            When the wheel refuses the command.
        PositionError
            When the wheel says that it stopped at another slot.
        """
        if self._target is None:
            return False
        frame = self._link.poll_until(_PROMPT)
        if frame is None:
            if self._deadline.has_passed():
                raise self._not_arrived(f"slot {self._target} was not reached")
            return True
        target, self._target = self._target, None
        with suppress(ReplyError):  # garbage behind the motion; the next question finds out where it has led
            self._accept(frame, f"pos={target}", _nothing)
        reached = self.slot()
        if reached != target:
            raise PositionError(
                self.name,
                f"the wheel was sent to slot {target} but stands at slot {reached}",
                not_done=f"slot {target} is not in the beam",
                to_do="check that nobody turned the wheel by its buttons and that it turns freely",
            )
        return False

    def remaining_s(self) -> float:
        """How long the slot should still be on its way, as fast as the rig file says."""
        return self._arrives_s - self._clock.now()

    def slot(self) -> int:
        """Which slot the wheel says is in the beam; after a motion that was not waited for, waits for its end."""
        self._seen = self._link.until_answered(lambda: self._query("pos?", whole_number))
        return self._seen

    def stop(self) -> None:
        """Do nothing: the wheel has no command to stop and ends its motion by itself within seconds.

        The answer still to come is found and dropped by the next question.
        """
        self._target = None

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError. A motion under way ends by itself."""
        self._target = None
        self._in_step = False
        self._link.reconnect()

    def close(self) -> None:
        """Close the port."""
        self._link.close()

    @property
    def _longest_motion_s(self) -> float:
        return 1.0 + 4.0 * (self.slots // 2)  # the wheel takes the shorter way round

    def _write(self, command: str) -> None:
        if not self._in_step:
            self._resynchronise()
        self._in_step = False
        self._link.write(command.encode("ascii") + b"\r")

    def _query(self, question: str, read: Callable[[str, str, str], T]) -> T:
        self._write(question)
        return self._accept(self._link.read_until(_PROMPT), question, read)

    def _accept(self, frame: bytes, command: str, read: Callable[[str, str, str], T]) -> T:
        exchange = parse_exchange(frame)
        if exchange.echo != command:
            raise unusable(self.name, command, frame.decode("ascii", errors="replace"), "its echo and an answer")
        if exchange.answer.startswith("Command error"):
            self._in_step = True
            raise DeviceFaultError(
                self.name,
                f"the wheel refused {command!r}: {exchange.answer}",
                not_done="the command was not carried out",
                to_do="check that the device is an FW102C or FW212C and that the rig file has its number of slots",
            )
        value = read(self.name, command, exchange.answer)
        self._in_step = True
        return value

    def _resynchronise(self) -> None:
        # Answers come in order, so whatever comes before the echo of a mark that was never sent before belongs to
        # commands that were given up, also a motion that has not ended. The mark is no command: with a command that was
        # typed in part it makes one that the wheel refuses. The nines take a slot number out of range, also for a wheel
        # that reads a number no further than its digits; a carriage return alone would carry out a half-typed motion.
        self._target = None
        self._marks += 1
        mark = f"999!{self._marks}"
        self._link.discard_input()
        self._link.write(mark.encode("ascii") + b"\r")
        deadline = Deadline(self._clock, self._longest_motion_s)
        self._clock.sleep(_POLL_S)  # in virtual time the answer is there now, whichever thread ran first
        while (frame := self._link.poll_until(_PROMPT)) is None or not parse_exchange(frame).echo.endswith(mark):
            if deadline.has_passed():
                raise self._not_arrived("nothing but a mark that is no command was sent")
            if frame is None:
                self._clock.sleep(_POLL_S)
        self._in_step = True

    def _not_arrived(self, not_done: str) -> ReplyTimeoutError:
        return ReplyTimeoutError(
            self.name,
            f"no prompt from the wheel on port {self._link.port} within {self._longest_motion_s:g} s",
            not_done=not_done,
            to_do="check that the wheel is on, turns freely and has the baud rate of the rig file",
        )


def _identity(device: str, question: str, answer: str) -> str:
    if "THORLABS" not in answer.upper():
        raise unusable(device, question, answer, "the identity of a Thorlabs filter wheel")
    return answer


def _nothing(device: str, question: str, answer: str) -> None:
    if answer:
        raise unusable(device, question, answer, "a prompt and nothing else")
