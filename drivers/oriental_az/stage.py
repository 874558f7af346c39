"""Oriental Motor AZ series drives on Modbus RTU: one rotary axis with an absolute encoder."""

from __future__ import annotations

from drivers.clock import Clock, Deadline
from drivers.modbus.unit import ModbusUnit
from drivers.oriental_az.registers import ALARMS, COMMUNICATION_ERRORS, HOME_NOT_SET, AzRegisters
from goniometer.errors import DeviceFaultError

_ABSOLUTE = 1
_FULL_CURRENT = 1000  # of 0.1 %
_START_WITH_ALL_DATA = 1
_ACCEPT_S = 0.2
_POLL_S = 0.005


class OrientalAz:
    """A stage with an absolute encoder; angles in degrees.

    Parameters
    ----------
    modbus : ModbusUnit
        The drive's unit on its port; opened by `connect`.
    clock : Clock
        Counts how long the drive takes to begin a move.
    name : str
        The axis' name in the rig file.
    steps_per_deg : float
        Motor steps that turn the axis by one degree, with gear.
    velocity_deg_s, acceleration_deg_s2 : float
        Of every motion; the deceleration is the acceleration.
    may_reset_home_alarm : bool
        Whether homing resets the alarm that home is not set, with which the drive otherwise refuses every motion. For a
        person who asks for homing and looks on; a scan does not.
    """

    reports_in_motion = True

    def __init__(
        self,
        modbus: ModbusUnit,
        clock: Clock,
        *,
        name: str,
        steps_per_deg: float,
        velocity_deg_s: float,
        acceleration_deg_s2: float,
        may_reset_home_alarm: bool = False,
    ) -> None:
        self.name, self.velocity_deg_s, self.acceleration_deg_s2 = name, velocity_deg_s, acceleration_deg_s2
        self._modbus, self._clock = modbus, clock
        self._steps_per_deg = steps_per_deg
        self._at = AzRegisters()
        self._under_way = "nothing was moved"
        self._may_reset_home_alarm, self._has_lost_home = may_reset_home_alarm, False

    def connect(self) -> tuple[str, ...]:
        """Open the port and check that the drive answers without an alarm; moves nothing and resets nothing.

        Returns
        -------
        tuple of str
            The alarm that homing is going to reset.
        """
        self._modbus.open()
        self._has_lost_home = self._may_reset_home_alarm and self._alarm() == HOME_NOT_SET
        if self._has_lost_home:
            return (f"{_in_words(HOME_NOT_SET)}, which homing resets",)
        self._output(not_done="nothing was moved")
        return ()

    def is_homed(self) -> bool:
        """Whether the drive knows its zero: it keeps it without power, and has an alarm when it is lost."""
        return not self._has_lost_home

    def start_homing(self) -> None:
        """Go back to the home position of the absolute encoder."""
        self._under_way = f"the return of {self.name} to its home position"
        if self._has_lost_home:
            self._reset_alarm()
        self._require_ready()
        self._modbus.write_register(self._at.driver_input_low, self._at.input_return_home)
        self._modbus.write_register(self._at.driver_input_low, 0)

    def start_move(self, target_deg: float) -> None:
        """Begin to move to `target_deg`, rounded to whole steps.

        Raises
        ------
        DeviceFaultError
            When the drive is not ready, has an alarm, or does not take up the move.
        """
        self._under_way = f"the move to {target_deg:g} degrees"
        self._require_ready()
        target_steps = round(target_deg * self._steps_per_deg)
        speed_hz = round(self.velocity_deg_s * self._steps_per_deg)
        rate = round(self.acceleration_deg_s2 * self._steps_per_deg)  # 0.001 kHz/s is one step/s²
        self._modbus.write_int32(
            self._at.direct_data,
            (0, _ABSOLUTE, target_steps, speed_hz, rate, rate, _FULL_CURRENT, _START_WITH_ALL_DATA),
        )
        self._confirm_accepted(target_steps)

    def is_moving(self) -> bool:
        """Ask whether the motion goes on; raises DeviceFaultError when the drive has an alarm."""
        output = self._output(self._under_way)
        if output & self._at.output_home_end:
            self._has_lost_home = False
        return bool(output & self._at.output_move) or not output & self._at.output_in_position

    def position_deg(self) -> float:
        """Where the encoder says the axis is."""
        return self._modbus.read_int32(self._at.feedback_position)[0] / self._steps_per_deg

    def stop(self) -> None:
        """Stop with the set deceleration; safe at any time."""
        self._modbus.write_register(self._at.driver_input_low, self._at.input_stop)
        self._modbus.write_register(self._at.driver_input_low, 0)

    def reconnect(self) -> None:
        """Open the port afresh; raises NotConnectedError."""
        self._modbus.reopen()

    def close(self) -> None:
        """Close the port; the motor stays powered and holds its position."""
        self._modbus.close()

    def _require_ready(self) -> None:
        if not self._output(self._under_way) & self._at.output_ready:
            raise DeviceFaultError(
                self.name,
                "the drive is not ready: it is still moving, or its motor is not powered",
                not_done=self._under_way,
                to_do="wait until the motion has ended; check the drive's power and its FREE and STOP inputs",
            )

    def _output(self, not_done: str) -> int:
        output, alarm = self._modbus.read_int32(self._at.driver_output, 2)
        if alarm:
            raise DeviceFaultError(
                self.name,
                f"the drive has {_in_words(alarm)}",
                not_done=not_done,
                to_do=f"goniometer home --axis {self.name}, which resets this alarm; if it comes back, set the home "
                "position at the drive, then home the axis again"
                if alarm == HOME_NOT_SET
                else "remove the cause, reset the alarm at the drive or switch the drive off and on, then start again",
            )
        return output

    def _alarm(self) -> int:
        return self._modbus.read_int32(self._at.driver_output, 2)[1]

    def _reset_alarm(self) -> None:
        for level in (0, 1):
            self._modbus.write_int32(self._at.alarm_reset, (level,))
        deadline = Deadline(self._clock, _ACCEPT_S)
        while self._alarm() and not deadline.has_passed():
            self._clock.sleep(_POLL_S)

    def _confirm_accepted(self, target_steps: int) -> None:
        # A drive that was not ready ignores the message without a word; one that has begun needs some time to say so.
        deadline = Deadline(self._clock, _ACCEPT_S)
        while not self._output(self._under_way) & self._at.output_move:
            if self._modbus.read_int32(self._at.command_position)[0] == target_steps:
                return
            if deadline.has_passed():
                code = self._modbus.read_int32(self._at.communication_error)[0]
                reason = COMMUNICATION_ERRORS.get(code, "unknown")
                raise DeviceFaultError(
                    self.name,
                    f"the drive did not begin the move (communication error 0x{code:02X}, {reason})",
                    not_done=self._under_way,
                    to_do="check the drive's STOP and FREE inputs and that velocity_deg_s, acceleration_deg_s2 and "
                    "steps_per_deg in the rig file suit the drive",
                )
            self._clock.sleep(_POLL_S)


def _in_words(alarm: int) -> str:
    return f"alarm 0x{alarm:02X}, {ALARMS.get(alarm, 'see its manual')}"
