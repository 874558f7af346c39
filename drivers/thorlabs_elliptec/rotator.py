"""Thorlabs Elliptec rotators ELL14 and ELL18, and ELL8, on a bus that several modules share."""

from __future__ import annotations

from drivers.home_offset import HomeOffset
from drivers.thorlabs_elliptec.bus import ElliptecBus
from drivers.thorlabs_elliptec.module import ElliptecModule
from drivers.thorlabs_elliptec.packets import hex_pulses
from goniometer.errors import ConfigurationError, DeviceFaultError, LimitError

_MODELS = {8: "ELL8", 14: "ELL14", 18: "ELL18"}
_TURN_DEG = 360
_FULL_VELOCITY_DEG_S = 430.0
_CLOCKWISE = "0"
_FARTHEST_PULSES = 2**31 - 1
# Jog steps that nobody would choose: set once the module is homed, and while it is not. A module that was switched off
# has forgotten its jog step, and with it its zero.
_HOMED, _NOT_HOMED = hex_pulses(1127), hex_pulses(1126)


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
    home_offset_deg : float or None
        The home offset that the module must have; None for whichever it has.

    Raises
    ------
    ConfigurationError
        When the velocity is not 1 to 100 percent.
    """

    reports_in_motion = False

    def __init__(
        self,
        bus: ElliptecBus,
        address: int,
        *,
        name: str,
        velocity_deg_s: float,
        acceleration_deg_s2: float,
        home_offset_deg: float | None = None,
    ) -> None:
        self.name, self.velocity_deg_s, self.acceleration_deg_s2 = name, velocity_deg_s, acceleration_deg_s2
        self._module, self._address = ElliptecModule(bus, address, name), address
        self._percent = round(100 * velocity_deg_s / _FULL_VELOCITY_DEG_S)
        if not 1 <= self._percent <= 100:
            raise ConfigurationError(
                [
                    f"{name}: velocity_deg_s {velocity_deg_s:g} is {self._percent} percent of an Elliptec module's "
                    f"{_FULL_VELOCITY_DEG_S:g}; allowed: 1 to 100 percent. Change it in the rig file."
                ]
            )
        self._home_offset = HomeOffset(name, home_offset_deg)
        self._pulses_per_turn = 0
        self._knows_home = self._is_homing = False

    @property
    def identity(self) -> str:
        """What the module said of itself, with its serial number."""
        return self._module.says

    def connect(self) -> tuple[str, ...]:
        """Check that the module is a rotator, read its pulses in a turn, and set its velocity; moves nothing.

        Returns
        -------
        tuple of str
            The error that was left in the module from earlier use, and its home offset.

        Raises
        ------
        DeviceFaultError
            When the module is no rotator, or another one than the last time, does not take the velocity, or has another
            home offset.
        """
        identity = self._module.identity()
        if identity.model not in _MODELS or identity.travel != _TURN_DEG or not identity.pulses:
            raise DeviceFaultError(
                self.name,
                f"the module with address {self._address:X} is of type {identity.model} with a travel of "
                f"{identity.travel} and {identity.pulses} pulses, not one of {', '.join(_MODELS.values())}",
                not_done="nothing was set and nothing was moved",
                to_do="check the address in the rig file",
            )
        self._pulses_per_turn = identity.pulses
        left_over = self._module.left_over()
        self._module.query("sv", f"{self._percent:02X}")
        percent = self._module.query("gv").unsigned
        if percent != self._percent:
            raise DeviceFaultError(
                self.name,
                f"the module keeps its velocity at {percent} percent, not {self._percent}",
                not_done="the module was not set up",
                to_do="change velocity_deg_s in the rig file",
            )
        return left_over + self._home_offset.check(self._degrees(self._module.query("go").pulses))

    def is_homed(self) -> bool:
        """Whether the module was homed by this driver, at whatever time, and was not switched off since."""
        self._knows_home = self._module.query("gj").data == _HOMED
        return self._knows_home

    def start_homing(self) -> None:
        """Begin to search the home position; raises DeviceFaultError when the module still moves."""
        self._module.refuse_in_motion("the homing")
        self._knows_home, self._is_homing = False, True
        self._module.begin(("sj", _NOT_HOMED), ("ho", _CLOCKWISE))

    def start_move(self, target_deg: float) -> None:
        """Begin to move to `target_deg`; the packet is sent once the bus is free and has been silent for 0.1 s.

        Raises
        ------
        LimitError
            When the target has more pulses than a packet holds; nothing is sent.
        DeviceFaultError
            When the module still moves.
        """
        pulses = round(target_deg / _TURN_DEG * self._pulses_per_turn)
        if abs(pulses) > _FARTHEST_PULSES:
            raise LimitError(
                self.name,
                f"the target {target_deg:g} degrees is more than the module can count",
                not_done="the move was refused and nothing was sent",
                to_do="change the angle in the recipe",
            )
        self._module.refuse_in_motion(f"the move to {target_deg:g} degrees")
        self._is_homing = False
        # a module that was switched off on the way, or just before, has gone to the angle of another zero
        self._module.begin(("ma", hex_pulses(pulses)), *[("gj", "")] * self._knows_home)

    def is_moving(self) -> bool:
        """Whether the module's answer, which ends a motion, is still to come.

        Raises
        ------
        DeviceFaultError
            When it says that the motion has failed, or has lost its home position.
        ReplyTimeoutError
            When it does not come.
        """
        answers = self._module.answers()
        if answers is None:
            return True
        if answers and self._is_homing:
            self._module.query("sj", _HOMED)
            self._is_homing = False
        elif answers and self._knows_home and answers[-1].data != _HOMED:
            raise DeviceFaultError(
                self.name,
                "the module has lost its home position: it was switched off or reset",
                not_done="the last motion has led elsewhere",
                to_do="check its power supply, then home it again",
            )
        return False

    def position_deg(self) -> float:
        """Where the module says it is; waits until the bus is free."""
        return self._degrees(self._module.query("gp").pulses)

    def stop(self) -> None:
        """Drop a move that was not sent yet; one under way ends by itself, which `is_moving` tells."""
        self._is_homing = False
        self._module.stop()

    def reconnect(self) -> None:
        """Open the bus' port afresh, once; raises NotConnectedError."""
        self._module.reconnect()

    def close(self) -> None:
        """Close the bus' port."""
        self._module.close()

    def _degrees(self, pulses: int) -> float:
        return pulses * _TURN_DEG / self._pulses_per_turn
