"""The motor of an AZ drive: an axis in steps, counted from the drive's origin, and where its operations end."""

from __future__ import annotations

from sim_devices.axis import Axis
from sim_devices.oriental_az.registers import DEFAULT_OPERATION, LARGEST, Operation, Type


class AzMotor:
    """A motor that stands at its origin.

    Parameters
    ----------
    axis : Axis
        What it turns; one step of the motor is the axis' step.
    """

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self._origin_steps = 0
        self._stop_rate = DEFAULT_OPERATION.stop_rate

    def command_steps(self, now_s: float) -> int:
        """Position to which the motor is told to be by now."""
        return round(self._axis.motor_deg(now_s) / self._axis.step_deg) - self._origin_steps

    def feedback_steps(self, now_s: float) -> int:
        """Position that the encoder tells."""
        return round(self._axis.position_deg(now_s) / self._axis.step_deg) - self._origin_steps

    def speed_hz(self, now_s: float) -> int:
        """Speed in steps per second, with its sign."""
        return round(self._axis.velocity_deg_s(now_s) / self._axis.step_deg)

    def is_moving(self, now_s: float) -> bool:
        """Whether it has not yet come to rest."""
        return self._axis.is_moving(now_s)

    @property
    def end_s(self) -> float:
        """When the last motion that was asked for ends."""
        return self._axis.end_s

    def preset(self, now_s: float) -> None:
        """Let the origin be here."""
        self._origin_steps += self.command_steps(now_s)

    def stop(self, now_s: float) -> None:
        """Come to rest at the stopping rate of the last operation."""
        self._axis.stop(now_s, deceleration_deg_s2=self._stop_rate * self._axis.step_deg)

    def run(self, operation: Operation, start_s: float) -> None:
        """Move as an operation says, from `start_s` on."""
        self._stop_rate = operation.stop_rate
        step_deg = self._axis.step_deg
        self._axis.move(
            (self._target_steps(operation, start_s) + self._origin_steps) * step_deg,
            start_s,
            velocity_deg_s=abs(operation.speed) * step_deg,
            acceleration_deg_s2=operation.rate * step_deg,
            deceleration_deg_s2=operation.stop_rate * step_deg,
        )

    def _target_steps(self, operation: Operation, now_s: float) -> int:
        here = self.command_steps(now_s)
        turn = round(360 / self._axis.step_deg)
        forward = (operation.position - here) % turn
        match operation.type:
            case Type.ABSOLUTE:
                return operation.position
            case Type.RELATIVE_TO_COMMAND:
                return here + operation.position
            case Type.RELATIVE_TO_FEEDBACK:
                return self.feedback_steps(now_s) + operation.position
            case Type.CONTINUOUS:
                # until it is stopped, or the position counter ends
                return LARGEST if operation.speed > 0 else -LARGEST
            case Type.WRAP_ABSOLUTE:
                return here - here % turn + operation.position % turn
            case Type.WRAP_SHORTEST:
                return here + (forward if forward <= turn / 2 else forward - turn)
            case Type.WRAP_FORWARD:
                return here + forward
            case _:
                return here + forward - (turn if forward else 0)
