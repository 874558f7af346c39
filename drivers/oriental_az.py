"""Oriental Motor AZ series drives on Modbus RTU: one rotary axis with an absolute encoder."""

from __future__ import annotations

from drivers.clock import Clock, Deadline
from drivers.modbus_rtu import ModbusRtu
from drivers.motion import motion_deadline, refuse_outside, still_moving, stop_or_warn
from goniometer.errors import DeviceFaultError

DIRECT_DATA = 0x0058  # eight items: data number, type, position, speed, two rates, current, trigger
DRIVER_INPUT_LOW = 0x007D
DRIVER_OUTPUT = 0x007E  # followed by the present alarm, 0x0080
COMMUNICATION_ERROR = 0x00AC
COMMAND_POSITION = 0x00C6
FEEDBACK_POSITION = 0x00CC

INPUT_STOP = 1 << 5
OUTPUT_READY = 1 << 5
OUTPUT_MOVE = 1 << 13
OUTPUT_IN_POSITION = 1 << 14

_ABSOLUTE = 1
_FULL_CURRENT = 1000  # of 0.1 %
_START_WITH_ALL_DATA = 1
_ACCEPT_S = 0.2
_POLL_S = 0.005

_ALARMS = {
    0x10: "position deviation",
    0x20: "over-current",
    0x21: "driver too hot",
    0x22: "over-voltage",
    0x25: "under-voltage",
    0x26: "motor too hot",
    0x28: "sensor error",
    0x30: "overload",
    0x31: "over-speed",
    0x4A: "home is not set",
    0x60: "both limit sensors active",
    0x66: "hardware over-travel",
    0x67: "software over-travel",
    0x70: "operation data error",
    0x85: "communication time-out",
}
_COMMUNICATION_ERRORS = {
    0x00: "no communication error",
    0x84: "frame error",
    0x88: "undefined command",
    0x8C: "value out of range",
    0x8D: "command not executable",
}


class OrientalAz:
    """A rotary axis; angles in degrees.

    Parameters
    ----------
    port : str
        ``socket://host:port`` or a serial port; opened by `connect`.
    clock : Clock
        Counts the deadlines of motions.
    name : str
        The axis' name in the rig file.
    unit : int
        Unit number on the bus, 1 to 31.
    steps_per_deg : float
        Motor steps that turn the axis by one degree, with gear.
    limits_deg : tuple of float
        Lowest and highest angle allowed.
    velocity_deg_s, acceleration_deg_s2 : float
        Of every motion; the deceleration is the acceleration.
    settle_s, tolerance_deg : float
        Time to come to rest, and how far from its target the axis may stop.
    baudrate, parity : int, str
        As set in the drive; without effect on a socket.
    reply_timeout_s : float
        Longest wait for one answer, in real seconds.
    """

    def __init__(
        self,
        port: str,
        clock: Clock,
        *,
        name: str,
        unit: int,
        steps_per_deg: float,
        limits_deg: tuple[float, float],
        velocity_deg_s: float,
        acceleration_deg_s2: float,
        settle_s: float,
        tolerance_deg: float,
        baudrate: int = 115200,
        parity: str = "E",
        reply_timeout_s: float = 1.0,
    ) -> None:
        self.name, self.settle_s, self.tolerance_deg = name, settle_s, tolerance_deg
        self.limits_deg, self.velocity_deg_s, self.acceleration_deg_s2 = limits_deg, velocity_deg_s, acceleration_deg_s2
        self._clock = clock
        self._steps_per_deg = steps_per_deg
        self._modbus = ModbusRtu(
            port, device=name, unit=unit, baudrate=baudrate, parity=parity, reply_timeout_s=reply_timeout_s
        )
        self._target_deg = 0.0
        self._deadline: Deadline | None = None

    def connect(self) -> None:
        """Open the port and check that the drive answers without an alarm; moves nothing."""
        self._modbus.open()
        self._output(not_done="nothing was moved")

    def start_move(self, target_deg: float) -> None:
        """Begin to move to `target_deg`, rounded to whole steps.

        Raises
        ------
        LimitError
            When the target is outside the limits; nothing is sent.
        DeviceFaultError
            When the drive is not ready, has an alarm, or does not take up the move.
        """
        refuse_outside(self.name, target_deg, self.limits_deg)
        not_done = f"the move to {target_deg:g} degrees"
        if not self._output(not_done) & OUTPUT_READY:
            raise DeviceFaultError(
                self.name,
                "the drive is not ready: it is still moving, or its motor is not powered",
                not_done=not_done,
                to_do="wait until the motion has ended; check the drive's power and its FREE and STOP inputs",
            )
        distance_deg = target_deg - self.position_deg()
        target_steps = round(target_deg * self._steps_per_deg)
        speed_hz = round(self.velocity_deg_s * self._steps_per_deg)
        rate = round(self.acceleration_deg_s2 * self._steps_per_deg)  # 0.001 kHz/s is one step/s²
        self._target_deg = target_deg
        self._modbus.write_int32(
            DIRECT_DATA, (0, _ABSOLUTE, target_steps, speed_hz, rate, rate, _FULL_CURRENT, _START_WITH_ALL_DATA)
        )
        self._deadline = motion_deadline(self._clock, distance_deg, self.velocity_deg_s, self.acceleration_deg_s2)
        self._confirm_accepted(target_steps, not_done)

    def is_moving(self) -> bool:
        """Ask whether the motion goes on; raises DeviceFaultError or ReplyTimeoutError when it has failed."""
        output = self._output(not_done=f"the move to {self._target_deg:g} degrees")
        if not output & OUTPUT_MOVE and output & OUTPUT_IN_POSITION:
            return False
        if self._deadline is not None and self._deadline.has_passed():
            raise still_moving(self.name, self._target_deg)
        return True

    def position_deg(self) -> float:
        """Where the encoder says the axis is."""
        return self._modbus.read_int32(FEEDBACK_POSITION)[0] / self._steps_per_deg

    def stop(self) -> None:
        """Stop with the set deceleration; safe at any time.

        Raises
        ------
        NotConnectedError
            When the link is gone and a fresh connection fails too: the axis may still be moving.
        """
        stop_or_warn(self.name, self._stop, self._modbus.reopen)

    def close(self) -> None:
        """Close the port; the motor stays powered and holds its position."""
        self._modbus.close()

    def _stop(self) -> None:
        self._modbus.write_register(DRIVER_INPUT_LOW, INPUT_STOP)
        self._modbus.write_register(DRIVER_INPUT_LOW, 0)

    def _output(self, not_done: str) -> int:
        output, alarm = self._modbus.read_int32(DRIVER_OUTPUT, 2)
        if alarm:
            raise DeviceFaultError(
                self.name,
                f"the drive has alarm 0x{alarm:02X}, {_ALARMS.get(alarm, 'see its manual')}",
                not_done=not_done,
                to_do="remove the cause, reset the alarm at the drive, then start again",
            )
        return output

    def _confirm_accepted(self, target_steps: int, not_done: str) -> None:
        # A drive that was not ready ignores the message without a word; one that has begun needs some time to say so.
        deadline = Deadline(self._clock, _ACCEPT_S)
        while not self._output(not_done) & OUTPUT_MOVE:
            if self._modbus.read_int32(COMMAND_POSITION)[0] == target_steps:
                return
            if deadline.has_passed():
                code = self._modbus.read_int32(COMMUNICATION_ERROR)[0]
                reason = _COMMUNICATION_ERRORS.get(code, "unknown")
                raise DeviceFaultError(
                    self.name,
                    f"the drive did not begin the move (communication error 0x{code:02X}, {reason})",
                    not_done=not_done,
                    to_do="check the drive's STOP and FREE inputs and that velocity_deg_s, acceleration_deg_s2 and "
                    "steps_per_deg in the rig file suit the drive",
                )
            self._clock.sleep(_POLL_S)
