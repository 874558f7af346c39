"""Thorlabs Elliptec rotators ELL14 and ELL18, and ELL8, on a bus that several modules share."""

from __future__ import annotations

from drivers.elliptec_bus import ElliptecBus
from drivers.elliptec_exchange import Exchange
from drivers.elliptec_packets import Packet, hex_pulses, identity_of, status_text
from goniometer.errors import ConfigurationError, DeviceFaultError, LimitError

_MODELS = {8: "ELL8", 14: "ELL14", 18: "ELL18"}
_TURN_DEG = 360
_FULL_VELOCITY_DEG_S = 430.0
_CLOCKWISE = "0"
_FARTHEST_PULSES = 2**31 - 1
# A jog step that nobody would choose. A module that was switched off has forgotten it, and with it its zero.
_MARK = hex_pulses(1127)


class ElliptecRotator:
    """One rotator.

    Parameters
    ----------
    bus : ElliptecBus
        The bus it is on.
    address : int
        Its address on the bus, 0 to 15.
    name : str
        The axis' name in the rig file.
    velocity_deg_s : float
        Speed of every move, told to the module in whole percent of 430 degrees/s; below half of it, modules may stall.
    acceleration_deg_s2 : float
        What to expect: the module has a ramp of its own.

    Raises
    ------
    ConfigurationError
        When the velocity is not 1 to 100 percent.
    """

    reports_in_motion = False

    def __init__(
        self, bus: ElliptecBus, address: int, *, name: str, velocity_deg_s: float, acceleration_deg_s2: float
    ) -> None:
        self.name, self.velocity_deg_s, self.acceleration_deg_s2 = name, velocity_deg_s, acceleration_deg_s2
        self._bus, self._address = bus, address
        self._percent = round(100 * velocity_deg_s / _FULL_VELOCITY_DEG_S)
        if not 1 <= self._percent <= 100:
            raise ConfigurationError(
                [
                    f"{name}: velocity_deg_s {velocity_deg_s:g} is {self._percent} percent of an Elliptec module's "
                    f"{_FULL_VELOCITY_DEG_S:g}; allowed: 1 to 100 percent. Change it in the rig file."
                ]
            )
        self._pulses_per_turn = 0
        self._was_homed = False
        self._under_way: tuple[Exchange, ...] = ()

    def connect(self) -> tuple[str, ...]:
        """Check that the module is a rotator, read its pulses in a turn, and set its velocity; moves nothing.

        Returns
        -------
        tuple of str
            The error that was left in the module from earlier use.

        Raises
        ------
        DeviceFaultError
            When the module is no rotator, or does not take the velocity.
        """
        identity = identity_of(self._bus.query(self.name, self._address, "in"))
        if identity.model not in _MODELS or identity.travel != _TURN_DEG or not identity.pulses:
            raise DeviceFaultError(
                self.name,
                f"the module with address {self._address:X} is of type {identity.model} with a travel of "
                f"{identity.travel} and {identity.pulses} pulses, not one of {', '.join(_MODELS.values())}",
                not_done="nothing was set and nothing was moved",
                to_do="check the address in the rig file",
            )
        self._pulses_per_turn = identity.pulses
        left_over = self._query("gs").unsigned
        self._query("sv", f"{self._percent:02X}")
        percent = self._query("gv").unsigned
        if percent != self._percent:
            raise DeviceFaultError(
                self.name,
                f"the module keeps its velocity at {percent} percent, not {self._percent}",
                not_done="the module was not set up",
                to_do="change velocity_deg_s in the rig file",
            )
        return (status_text(left_over),) if left_over else ()

    def is_homed(self) -> bool:
        """Whether this driver has homed the module, and the module was not switched off since."""
        return self._was_homed and self._query("gj").data == _MARK

    def start_homing(self) -> None:
        """Begin to search the home position."""
        self._refuse_in_motion("the homing")
        self._was_homed = False
        # begun together, so that no other module's motion comes between
        self._under_way = self._begin("ho", _CLOCKWISE), self._begin("sj", _MARK)

    def start_move(self, target_deg: float) -> None:
        """Begin to move to `target_deg`; the packet is sent once the bus is free and has been silent for 0.1 s.

        Raises
        ------
        LimitError
            When the target has more pulses than a packet holds; nothing is sent.
        DeviceFaultError
            When the module still moves.
        """
        motion = f"the move to {target_deg:g} degrees"
        pulses = round(target_deg / _TURN_DEG * self._pulses_per_turn)
        if abs(pulses) > _FARTHEST_PULSES:
            raise LimitError(
                self.name,
                f"the target {target_deg:g} degrees is more than the module can count",
                not_done="the move was refused and nothing was sent",
                to_do="change the angle in the recipe",
            )
        self._refuse_in_motion(motion)
        self._under_way = (self._begin("ma", hex_pulses(pulses)),)

    def is_moving(self) -> bool:
        """Whether the module's answer, which ends a motion, is still to come.

        Raises
        ------
        DeviceFaultError
            When it says that the motion has failed.
        ReplyTimeoutError
            When it does not come.
        """
        if not self._under_way:
            return False
        self._bus.pump()
        if not all(exchange.is_over for exchange in self._under_way):
            return True
        ended, self._under_way = self._under_way, ()
        for exchange in ended:
            exchange.answer()
        self._was_homed |= ended[0].letters == "ho"
        return False

    def position_deg(self) -> float:
        """Where the module says it is; waits until the bus is free."""
        return self._query("gp").pulses * _TURN_DEG / self._pulses_per_turn

    def stop(self) -> None:
        """Stop, and drop a move that was not sent yet; returns when the module has answered."""
        self._under_way = ()
        self._bus.stop(self.name, self._address)

    def reconnect(self) -> None:
        """Open the bus' port afresh; raises NotConnectedError."""
        self._bus.reconnect()

    def close(self) -> None:
        """Close the bus' port."""
        self._bus.close()

    def _begin(self, letters: str, data: str) -> Exchange:
        return self._bus.start(Exchange(self.name, self._address, letters, data))

    def _query(self, letters: str, data: str = "") -> Packet:
        return self._bus.query(self.name, self._address, letters, data)

    def _refuse_in_motion(self, not_done: str) -> None:
        if self.is_moving():
            raise DeviceFaultError(
                self.name,
                "the module has not ended its last motion",
                not_done=not_done,
                to_do="wait until it has, or stop it",
            )
