"""One Thorlabs Elliptec module on its bus: what it is asked, what it was told to do, and whether it rests."""

from __future__ import annotations

from drivers.same_device import same_device
from drivers.thorlabs_elliptec.bus import ElliptecBus
from drivers.thorlabs_elliptec.exchange import Exchange
from drivers.thorlabs_elliptec.packets import BUSY, Identity, Packet, identity_of, status_text
from goniometer.errors import DeviceFaultError


class ElliptecModule:
    """A module, of whatever kind.

    A motion to a target cannot be stopped, and a module that still moves answers the next motion as it answers an
    unfinished one, "busy". So none is begun before the last has ended, or the module says that it rests.

    Parameters
    ----------
    bus : ElliptecBus
        The bus it is on.
    address : int
        Its address on the bus, 0 to 15.
    name : str
        The device's name, for messages.
    """

    def __init__(self, bus: ElliptecBus, address: int, name: str) -> None:
        self._bus, self._address, self._name = bus, address, name
        self._under_way: tuple[Exchange, ...] = ()
        self._rests = False
        self.says = ""

    def identity(self) -> Identity:
        """What it says of itself; raises DeviceFaultError when that is another module than the last time."""
        packet = self.query("in")
        self.says = same_device(self._name, self.says, packet.data)
        return identity_of(packet)

    def query(self, letters: str, data: str = "") -> Packet:
        """Wait for the answer to a packet that is safe to repeat; other modules' motions end first."""
        return self._bus.query(self._name, self._address, letters, data)

    def left_over(self) -> tuple[str, ...]:
        """The error that was left in the module from earlier use, which forgets it by this; none while it moves."""
        status = self.query("gs").unsigned
        self._rests = status != BUSY
        return (status_text(status),) if status not in (0, BUSY) else ()

    def begin(self, *packets: tuple[str, str]) -> None:
        """Begin a motion, with what is to follow it before another module's motion; each is letters and data."""
        self._rests = False
        self._under_way = tuple(
            self._bus.start(Exchange(self._name, self._address, letters, data)) for letters, data in packets
        )

    def answers(self) -> tuple[Packet, ...] | None:
        """The answers to what was begun, once; None while the module moves, and nothing when it rests.

        Raises
        ------
        DeviceFaultError
            When the module says that its motion has failed.
        ReplyTimeoutError
            When it does not answer.
        """
        if self._under_way:
            self._bus.pump()
            if not all(exchange.is_over for exchange in self._under_way):
                return None
            ended, self._under_way = self._under_way, ()
            answers = tuple(exchange.answer() for exchange in ended)
            self._rests = True
            return answers
        if not self._rests:
            status = self.query("gs").unsigned
            if status == BUSY:
                return None
            self._rests = True
            if status:
                raise DeviceFaultError(
                    self._name,
                    f"the module's last motion has ended with status {status}, {status_text(status)}",
                    not_done="the motion was not carried out to its end",
                    to_do="look whether the mount turns freely and the module has its 5 V, then home it",
                )
        return ()

    def rests(self) -> bool:
        """Ask whether it rests, also from what a person began at its button; raises as `answers` does."""
        if self._under_way:
            return False
        self._rests = False
        return self.answers() is not None

    def refuse_in_motion(self, not_done: str) -> None:
        """Raise DeviceFaultError while the module moves."""
        if self.answers() is None:
            raise DeviceFaultError(
                self._name, "the module has not ended its last motion", not_done=not_done, to_do="wait until it has"
            )

    def stop(self) -> None:
        """Stop, as far as the module can, and drop what was not sent yet; returns when the module has answered."""
        self._under_way = ()
        self._bus.stop(self._name, self._address)

    def reconnect(self) -> None:
        """Open the bus' port afresh, once; raises NotConnectedError."""
        self._bus.reconnect()

    def close(self) -> None:
        """Close the bus' port."""
        self._bus.close()
