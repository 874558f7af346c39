"""One port with Thorlabs APT controllers behind it, handing to each of several bays the answers that are its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import cycle
from typing import TypeVar

from drivers.clock import Clock
from drivers.thorlabs_apt.messages import (
    CHANNEL,
    GET_BAY_USED,
    GET_CHANNEL_ENABLED,
    GET_INFO,
    GET_VELOCITY,
    RACK,
    REQ_BAY_USED,
    REQ_CHANNEL_ENABLED,
    REQ_INFO,
    REQ_VELOCITY,
    Garbled,
    Message,
    fault_of,
    short_message,
    take_message,
)
from drivers.wire.link import Link
from goniometer.errors import ReplyError

T = TypeVar("T")

_OPENING_PAUSE_S = 0.05
# Taken in turn, so that an answer that comes one time-out late is not taken for that of the next proof.
_RACK_PROOFS = ((REQ_INFO, 0, GET_INFO), (REQ_BAY_USED, 0, GET_BAY_USED))
_MOTOR_PROOFS = ((REQ_VELOCITY, CHANNEL, GET_VELOCITY), (REQ_CHANNEL_ENABLED, CHANNEL, GET_CHANNEL_ENABLED))


class AptPort:
    """One question at a time, matched with its answer by number and source.

    A controller answers in order, but its messages have no checksum, and an answer does not say which of two like
    questions it belongs to. After an answer that was none, or never came, an address is therefore asked for something
    else before it is trusted again, and all that comes before that answer is dropped.

    Parameters
    ----------
    link : Link
        115200 baud with RTS/CTS.
    clock : Clock
        Times the pauses with which a port is opened, and the motions.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.clock = clock
        self._link = link
        self._links: dict[str, Link] = {}
        self._is_prepared = False
        self._proven: set[int] = set()
        self._proofs: dict[int, Iterator[tuple[int, int, int]]] = {}
        self._reports: dict[int, list[str]] = {}
        link.on_reopen(self._forget)

    def send(self, device: str, message: bytes) -> None:
        """Send a message that has no answer, or one whose answer is not waited for."""
        self._prepare()
        self._link_of(device).write(message)

    def request(self, device: str, address: int, question: bytes, answer: int, read: Callable[[Message], T]) -> T:
        """Send a question, which may be repeated, and return what `read` makes of its answer.

        Raises
        ------
        ReplyTimeoutError
            When the answer has not come within the reply timeout.
        ReplyError
            When bytes came that are no message, or `read` raised Garbled.
        """
        self._prepare()
        link = self._link_of(device)
        return link.until_answered(lambda: self._ask(link, address, question, answer, read))

    def take_reports(self, address: int) -> tuple[str, ...]:
        """The faults that the device at this address has reported of its own accord since it was last asked."""
        return tuple(self._reports.pop(address, ()))

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError."""
        self._link.reconnect()

    def close(self) -> None:
        """Close the port; motors stay powered and hold their positions."""
        self._link.close()

    def _link_of(self, device: str) -> Link:
        if device not in self._links:
            self._links[device] = self._link.for_device(device)
        return self._links[device]

    def _forget(self) -> None:
        self._is_prepared = False
        self._proven.clear()

    def _prepare(self) -> None:
        if self._is_prepared:
            return
        self._link.set_rts(on=True)
        self.clock.sleep(_OPENING_PAUSE_S)
        self._link.discard_input()
        self.clock.sleep(_OPENING_PAUSE_S)
        self._link.set_rts(on=False)
        self._is_prepared = True

    def _ask(self, link: Link, address: int, question: bytes, answer: int, read: Callable[[Message], T]) -> T:
        self._link.poll(self._note_all)
        if address not in self._proven:
            self._prove(link, address, answer)
        self._proven.discard(address)
        link.write(question)
        try:
            value = read(link.read(lambda received: self._next(received, address, answer)))
        except Garbled as error:
            raise ReplyError(
                link.device,
                f"the answer to {question.hex(' ')} on port {link.port} is garbled: {error}",
                not_done="the answer was not used",
                to_do="check that the port in the rig file belongs to this device; if it happens now and then, look "
                "for a loose cable",
            ) from error
        self._proven.add(address)
        return value

    def _note_all(self, received: bytearray) -> None:
        with suppress(Garbled):
            while (message := take_message(received)) is not None:
                self._note(message)
        if received:  # garbage, or a message that has come in part
            self._proven.clear()

    def _prove(self, link: Link, address: int, wanted: int) -> None:
        proofs = self._proofs.setdefault(address, cycle(_RACK_PROOFS if address == RACK else _MOTOR_PROOFS))
        question, first, answer = next(proof for proof in proofs if proof[2] != wanted)
        link.discard_input()
        link.write(short_message(question, address, first))
        link.read(lambda received: self._next_after_garbage(received, address, answer))
        self._proven.add(address)

    def _next(self, received: bytearray, address: int, number: int) -> Message | None:
        while (message := take_message(received)) is not None:
            if (message.source, message.number) == (address, number):
                return message
            self._note(message)
        return None

    def _next_after_garbage(self, received: bytearray, address: int, number: int) -> Message | None:
        while True:
            try:
                return self._next(received, address, number)
            except Garbled:
                del received[:1]

    def _note(self, message: Message) -> None:
        fault = fault_of(message)
        if fault is not None:
            self._reports.setdefault(message.source, []).append(fault)
