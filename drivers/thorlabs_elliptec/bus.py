"""The one wire that several Thorlabs Elliptec modules share: one packet and its answer at a time, in order."""

from __future__ import annotations

from collections import deque
from itertools import cycle

from drivers.clock import Clock
from drivers.thorlabs_elliptec.exchange import PROOFS, Exchange
from drivers.thorlabs_elliptec.packets import UNSOLICITED, Packet, parse_packet
from drivers.wire.link import Link
from goniometer.errors import DeviceError, NotConnectedError, ReplyTimeoutError

_LINE_END = b"\r\n"
_CLEAR = b"\r"  # makes a module forget a packet of which it has only a part
_PAUSE_S = 0.1  # a module may misread a move that comes sooner after an answer
_POLL_S = 0.01


class ElliptecBus:
    """A bus, half duplex: no module is spoken to while another has an answer outstanding.

    A motion is answered when it has ended, so that the modules of one bus move one after another. Exchanges wait in a
    queue, and whichever module's driver polls moves it on.

    Answers do not say what was asked. After one that was none, or never came, a module is asked for what cannot be
    mistaken before it is trusted again, and what it says before is dropped.

    Parameters
    ----------
    link : Link
        9600 baud, no handshake.
    clock : Clock
        Times the pauses between packets and the answers.

    Attributes
    ----------
    unsolicited : int
        Packets that modules sent because a person used their buttons or a handset.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.unsolicited = 0
        self._link, self._clock = link, clock
        self._links: dict[str, Link] = {}
        self._queue: deque[Exchange] = deque()
        self._active: Exchange | None = None
        self._proven: set[int] = set()
        self._proofs = cycle(PROOFS)  # in turn, so that a late answer to one is not taken for that to the next
        self._heard_s = clock.now() - _PAUSE_S
        link.on_reopen(self._forget)

    def start(self, exchange: Exchange) -> Exchange:
        """Put an exchange into the queue; `pump` then moves it on."""
        self._queue.append(exchange)
        self.pump()
        return exchange

    def query(self, device: str, address: int, letters: str, data: str = "") -> Packet:
        """Wait for the answer to a packet that is safe to repeat; other modules' motions end first.

        Raises
        ------
        ReplyTimeoutError
            When the module does not answer.
        ReplyError
            When its answer is none.
        DeviceFaultError
            When it answers with an error.
        """
        link = self._link_of(device)
        return link.until_answered(lambda: self._finish(self.start(Exchange(device, address, letters, data))))

    def stop(self, device: str, address: int) -> None:
        """Stop a module and forget its exchanges; returns when it has answered.

        Nothing is sent to a module at rest while another has an answer outstanding.
        """
        self._queue = deque(exchange for exchange in self._queue if exchange.address != address)
        if self._active is not None and self._active.address == address:
            self._active = None
        elif self._active is not None and address in self._proven:
            return
        self._proven.discard(address)
        stop = Exchange(device, address, "st")
        self._queue.appendleft(stop)
        self.pump()
        self._finish(stop)

    def pump(self) -> None:
        """Take what has come and send what may be sent; never waits.

        Raises
        ------
        NotConnectedError
            When the link is gone; every exchange then fails with the same error.
        """
        try:
            while (line := self._link.poll_until(_LINE_END)) is not None:
                self._take(line)
            if self._active is not None:
                self._active.check_time()
                self._end_active()
            self._send_next()
        except DeviceError as error:
            self._give_all_up(error)
            raise

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError."""
        self._link.reconnect()

    def close(self) -> None:
        """Close the port; motions that were begun end by themselves."""
        self._link.close()

    def _finish(self, exchange: Exchange) -> Packet:
        while not exchange.is_over:
            if self._active is None or self._active.is_motion:
                self._clock.sleep(_POLL_S)
            else:
                self._wait_for_answer(self._active)
            if not exchange.is_over:
                self.pump()
        return exchange.answer()

    def _wait_for_answer(self, active: Exchange) -> None:
        try:
            self._take(self._link.read_until(_LINE_END))
        except ReplyTimeoutError:
            active.time_out()
            self._end_active()
        except DeviceError as error:
            self._give_all_up(error)
            raise

    def _take(self, line: bytes) -> None:
        packet = parse_packet(line)
        if packet is not None and packet.kind in UNSOLICITED:
            self.unsolicited += 1
            return
        self._heard_s = self._clock.now()
        if packet is not None and (self._active is None or packet.address != self._active.address):
            self._proven.discard(packet.address)  # a late answer: where there was one, there may be more
        elif self._active is not None:
            if packet is None:
                self._active.refuse(line.decode("latin-1"))
            else:
                self._active.take(packet)
            self._end_active()

    def _end_active(self) -> None:
        exchange = self._active
        if exchange is None or not exchange.is_over:
            return
        self._active = None
        try:
            exchange.answer()
            if exchange.is_proof:
                self._proven.add(exchange.address)
        except DeviceError as error:
            self._proven.discard(exchange.address)
            if exchange.is_proof and self._queue and self._queue[0].address == exchange.address:
                self._queue.popleft().fail(error)

    def _send_next(self) -> None:
        if self._active is not None or not self._queue:
            return
        exchange = self._queue[0]
        if self._link.has_input():
            self._link.discard_input()
            self._proven.clear()
        if exchange.is_motion and self._clock.now() - self._heard_s < _PAUSE_S:
            return
        if exchange.address not in self._proven and not exchange.is_proof and exchange.letters != "st":
            exchange = Exchange(exchange.device, exchange.address, next(self._proofs))
        else:
            self._queue.popleft()
        begins_afresh = exchange.is_proof or exchange.letters == "st"
        self._link_of(exchange.device).write(_CLEAR * begins_afresh + exchange.packet)
        exchange.begin(self._clock)
        self._active = exchange

    def _link_of(self, device: str) -> Link:
        if device not in self._links:
            self._links[device] = self._link.for_device(device)
        return self._links[device]

    def _give_all_up(self, error: DeviceError) -> None:
        for exchange in (self._active, *self._queue):
            if exchange is not None:
                exchange.fail(error)
        self._active = None
        self._queue.clear()
        self._proven.clear()

    def _forget(self) -> None:
        self._give_all_up(
            NotConnectedError(
                self._link.device,
                "the port was opened afresh before the module had answered",
                not_done="what was asked of the module may have been carried out, in part or not at all",
                to_do="look at the module, and begin again",
            )
        )
