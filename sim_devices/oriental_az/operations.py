"""What starts and stops the motor of an AZ drive, and the alarms that forbid it."""

from __future__ import annotations

from collections.abc import Callable

from sim_devices.axis import Axis
from sim_devices.oriental_az.motor import AzMotor
from sim_devices.oriental_az.registers import DEFAULT_OPERATION, Input, Operation, Output, Type, stored

DATA_ALARM, OVERTRAVEL_ALARM, HOME_ALARM = 0x70, 0x66, 0x4A
_HOMING = Operation(Type.ABSOLUTE, 0, 5_000, 1_000_000, 1_000_000, 1_000)
_JOG = DEFAULT_OPERATION._replace(type=Type.RELATIVE_TO_COMMAND, position=1)
# what has no need of a home position
_WITHOUT_HOME = (Type.RELATIVE_TO_COMMAND, Type.RELATIVE_TO_FEEDBACK, Type.CONTINUOUS)


class AzOperations:
    """The operations of a drive whose home is set.

    Parameters
    ----------
    axis : Axis
        What it turns.
    stored_at : callable
        The operation that is stored at an address.

    Attributes
    ----------
    motor : AzMotor
        What moves.
    alarm : int
        The alarm that is on; 0 for none.
    """

    def __init__(self, axis: Axis, stored_at: Callable[[int], Operation]) -> None:
        self.motor = AzMotor(axis)
        self.alarm = 0
        self._stored_at = stored_at
        self._has_home = True
        self._levels = Input(0)

    def trip(self, alarm: int, now_s: float) -> None:
        """Let a protection stop the motor; nothing moves until the alarm is reset."""
        self.alarm = alarm
        self.motor.stop(now_s)

    def lose_home(self, now_s: float) -> None:
        """Forget where home is, until a position is preset."""
        self._has_home = False
        self.trip(HOME_ALARM, now_s)

    def preset(self, now_s: float) -> None:
        """Let the origin be here."""
        self.motor.preset(now_s)
        self._has_home = True

    def power_cycle(self, now_s: float) -> None:
        """Stop, and forget alarm and inputs; the encoder is absolute."""
        self.motor.stop(now_s)
        self.alarm, self._levels = 0, Input(0)

    def output(self, now_s: float) -> int:
        """The driver output status, without what it repeats of the inputs."""
        moving = self.motor.is_moving(now_s)
        output = Output.MOVE if moving else Output.IN_POS
        if not moving and self._has_home and self.motor.command_steps(now_s) == 0:
            output |= Output.HOME_END
        if self._is_ready(now_s):
            output |= Output.READY
        if self.alarm:
            output |= Output.ALM_A
        return output

    def start(self, operation: Operation, now_s: float, *, buffered: bool = False) -> bool:
        """Begin an operation, behind the one under way where it is buffered; an alarm when it is none.

        Returns
        -------
        bool
            Whether the drive was ready for it.
        """
        follows = buffered and self.motor.is_moving(now_s) and not self.alarm
        start_s = self.motor.end_s if follows else now_s
        if not self._is_ready(start_s):
            return False
        if operation.speed == 0:
            self.alarm = DATA_ALARM
        elif not self._has_home and operation.type not in _WITHOUT_HOME:
            self.alarm = HOME_ALARM
        else:
            self.motor.run(operation, start_s)
        return True

    def take_inputs(self, before: int, after: int, now_s: float) -> bool:
        """Let inputs change; what begins when one rises, begins. Returns whether the drive was ready for that."""
        risen, fallen = Input(after & ~before & 0xFFFF), Input(before & ~after & 0xFFFF)
        self._levels = Input(after & 0xFFFF)
        if risen & Input.ALM_RST:
            self.alarm = 0
        if after & (Input.STOP | Input.FREE) or fallen & (Input.FW_POS | Input.RV_POS):
            self.motor.stop(now_s)
        was_ready = True
        for bit, operation in self._operations_of_inputs(after).items():
            if risen & bit:
                was_ready &= self.start(operation, now_s)
        return was_ready

    def _is_ready(self, now_s: float) -> bool:
        held = self._levels & (Input.STOP | Input.FREE)
        return not (held or self.alarm or self.motor.is_moving(now_s))

    def _operations_of_inputs(self, levels: int) -> dict[Input, Operation]:
        """What each input starts when it rises."""
        chosen = self._stored_at(stored(levels & Input.M))
        return {
            Input.START: chosen,
            Input.SSTART: chosen,
            Input.D_SEL0: self._stored_at(stored(0)),
            Input.D_SEL1: self._stored_at(stored(1)),
            Input.D_SEL2: self._stored_at(stored(2)),
            Input.ZHOME: _HOMING,
            Input.FW_JOG_P: _JOG,
            Input.RV_JOG_P: _JOG._replace(position=-_JOG.position),
            Input.FW_POS: chosen._replace(type=Type.CONTINUOUS, speed=abs(chosen.speed)),
            Input.RV_POS: chosen._replace(type=Type.CONTINUOUS, speed=-abs(chosen.speed)),
        }
