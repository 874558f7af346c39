"""SMC LEC controllers (LECP6, LECA6, JXC51 and JXC61) with an LER rotary table, on Modbus."""

from __future__ import annotations

from enum import Enum, auto

from drivers.clock import Clock, Deadline
from drivers.modbus.unit import ModbusUnit
from drivers.smc_lec.controller import LecStatus, SmcLecController
from drivers.smc_lec.registers import LecRegisters
from goniometer.errors import ConfigurationError, DeviceFaultError

_COUNTS_PER_DEG = 100
_AT_TARGET = 10  # counts
_FASTEST = 0xFFFF
_IDLE_S = 0.5  # the longest that it may stand still before it begins, or before it says that it has finished


class _Doing(Enum):
    NOTHING = auto()
    HOMING = auto()
    MOVING = auto()


class SmcLec:
    """A rotary table, satisfying `drivers.stage.Stage`.

    Parameters
    ----------
    modbus : ModbusUnit
        38400 baud, no parity on RS-485.
    clock : Clock
        Counts how long the controller may take to begin.
    name : str
        The stage's name in the rig file.
    velocity_deg_s, acceleration_deg_s2 : float
        Of every motion; the controller holds whole numbers from 1 to 65535.
    registers : LecRegisters, optional
        What the firmware expects, where it is not the usual one.
    may_reset_alarm : bool
        Whether `connect` resets an alarm. For a person who asks for homing and looks on; a scan does not.

    Raises
    ------
    ConfigurationError
        When the controller cannot hold the velocity or the acceleration.
    """

    reports_in_motion = True

    def __init__(
        self,
        modbus: ModbusUnit,
        clock: Clock,
        *,
        name: str,
        velocity_deg_s: float,
        acceleration_deg_s2: float,
        registers: LecRegisters | None = None,
        may_reset_alarm: bool = False,
    ) -> None:
        faults = [
            f"{name}: {key} is {value:g}; allowed: whole numbers from 1 to {_FASTEST}, as the controller holds them"
            for key, value in (("velocity_deg_s", velocity_deg_s), ("acceleration_deg_s2", acceleration_deg_s2))
            if value not in range(1, _FASTEST + 1)
        ]
        if faults:
            raise ConfigurationError(faults)
        self.name, self.velocity_deg_s, self.acceleration_deg_s2 = name, velocity_deg_s, acceleration_deg_s2
        self._modbus, self._clock = modbus, clock
        self._lec = SmcLecController(modbus, clock, name=name, registers=registers or LecRegisters())
        self._may_reset_alarm = may_reset_alarm
        self._doing = _Doing.NOTHING
        self._intention = "nothing was moved"
        self._target = 0
        self._was_homed = self._has_begun = False
        self._idle = Deadline(clock, 0.0)

    def connect(self) -> tuple[str, ...]:
        """Take control, clear what was left over, and switch the servo on; moves nothing.

        Returns
        -------
        tuple of str
            An alarm or a held motion that was left over.

        Raises
        ------
        DeviceFaultError
            When the emergency stop is pressed, there is an alarm that may not be reset, or stays, or the servo stays
            off.
        """
        notes = []
        self._intention = "the stage was not set up"
        self._lec.take_control()
        status = self._lec.status()
        if status.emergency_stop:
            raise self._emergency_stop()
        if status.alarm:
            if not self._may_reset_alarm:
                raise self._alarm()
            self._lec.reset_alarm()
            notes.append("an alarm, which was reset")
        if self._lec.is_held() and self._lec.end_hold():
            notes.append("a motion on hold, which was given up")
        self._lec.switch_servo_on()
        return tuple(notes)

    def is_homed(self) -> bool:
        """Whether it has returned to its origin since it was switched on."""
        return self._lec.status().homed

    def start_homing(self) -> None:
        """Begin to return to the origin; raises DeviceFaultError when the controller is not able to."""
        self._intention = "the return to the origin"
        self._was_homed = self._able().homed
        self._lec.begin_homing()
        self._expect(_Doing.HOMING)

    def start_move(self, target_deg: float) -> None:
        """Begin to move to `target_deg`, rounded to 0.01 degrees.

        Raises
        ------
        DeviceFaultError
            When there is an alarm or an emergency stop, the servo is off, the origin is unknown, or it still moves.
        """
        self._intention = f"the move to {target_deg:g} degrees"
        self._require_origin(self._able())
        self._target = round(target_deg * _COUNTS_PER_DEG)
        self._lec.begin_move(
            self._target,
            speed_deg_s=int(self.velocity_deg_s),
            acceleration_deg_s2=int(self.acceleration_deg_s2),
        )
        self._expect(_Doing.MOVING)

    def is_moving(self) -> bool:
        """Ask the controller.

        Raises
        ------
        DeviceFaultError
            When there is an alarm or an emergency stop, the servo went off, the origin was lost, or the controller did
            not begin what it was told to do.
        """
        status = self._sound()
        if self._doing is _Doing.NOTHING:
            return status.busy and not (self._lec.is_held() and self._lec.motion().speed_deg_s == 0)
        if self._doing is _Doing.MOVING:
            self._require_origin(status)
        if status.busy:
            self._has_begun, self._idle = True, Deadline(self._clock, _IDLE_S)
            return True
        if self._has_ended(status):
            if self._doing is _Doing.HOMING:
                self._lec.end_homing()
            self._doing = _Doing.NOTHING
            return False
        if self._idle.has_passed():
            raise self._fault(
                "the controller stands still and has not done what it was told",
                "read its alarms and its operation mode, and look whether another master drives it",
            )
        return True

    def position_deg(self) -> float:
        """Where the controller says it is."""
        return self._lec.motion().position / _COUNTS_PER_DEG

    def stop(self) -> None:
        """Stop with the set deceleration and stay on hold until the next motion; safe at any time."""
        self._doing = _Doing.NOTHING
        self._lec.hold()

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError."""
        self._modbus.reopen()

    def close(self) -> None:
        """Close the port; the servo stays on and holds the position."""
        self._modbus.close()

    def _able(self) -> LecStatus:
        status = self._sound()
        if self._lec.is_held():
            self._lec.end_hold()
            status = self._sound()
        if status.busy:
            raise self._fault("it still moves", "wait until the motion has ended")
        return status

    def _expect(self, doing: _Doing) -> None:
        self._doing, self._has_begun, self._idle = doing, False, Deadline(self._clock, _IDLE_S)

    def _has_ended(self, status: LecStatus) -> bool:
        if self._doing is _Doing.HOMING:
            return status.homed and (self._has_begun or not self._was_homed)
        motion = self._lec.motion()
        is_there = abs(motion.position - self._target) <= _AT_TARGET
        return motion.target == self._target and (self._has_begun or is_there) and self._lec.is_taken()

    def _sound(self) -> LecStatus:
        status = self._lec.status()
        if status.emergency_stop:
            raise self._emergency_stop()
        if status.alarm:
            raise self._alarm()
        if not status.servo_ready:
            raise self._fault("its servo is off", "look whether the controller was switched off and on; start again")
        return status

    def _require_origin(self, status: LecStatus) -> None:
        if not status.homed:
            raise self._fault(
                "it does not know its origin: the controller was switched off, or the table never homed",
                f"clear the way of the table, then: goniometer home --axis {self.name}",
            )

    def _alarm(self) -> DeviceFaultError:
        return self._fault(
            "the controller has an alarm",
            f"read the alarm from the controller, remove its cause, then: goniometer home --axis {self.name}, which "
            "resets it",
        )

    def _emergency_stop(self) -> DeviceFaultError:
        return self._fault("its emergency stop is pressed", "see that all is safe, release it, then start again")

    def _fault(self, happened: str, to_do: str) -> DeviceFaultError:
        return DeviceFaultError(self.name, happened, not_done=self._intention, to_do=to_do)
