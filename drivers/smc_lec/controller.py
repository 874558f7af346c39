"""What an SMC LEC controller can be told, and what it says of itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivers.clock import Clock, Deadline
from drivers.modbus.unit import ModbusUnit, int32s, words_of
from drivers.smc_lec.registers import LecRegisters
from goniometer.errors import DeviceFaultError

_FULL_FORCE_PERCENT = 100
_IN_POSITION_WIDTH = 10  # of 0.01 degrees
_REST = 1  # of 0.01 degrees from its target: a table that stands there does not go on
_SWITCH_S = 2.0  # until a servo is on or off, or an alarm gone
_POLL_S = 0.01


@dataclass(frozen=True)
class LecStatus:
    """The controller's outputs."""

    busy: bool
    servo_ready: bool
    homed: bool
    emergency_stop: bool
    alarm: bool


@dataclass(frozen=True)
class LecMotion:
    """Where it is and where it goes, in 0.01 degrees, and how fast, in degrees per second."""

    position: int
    speed_deg_s: int
    target: int


class SmcLecController:
    """One controller; the parameters are those of `SmcLec`."""

    def __init__(self, modbus: ModbusUnit, clock: Clock, *, name: str, registers: LecRegisters) -> None:
        self._modbus, self._clock, self._name, self._at = modbus, clock, name, registers

    def take_control(self) -> None:
        """Have it obey this line instead of its parallel inputs; raises DeviceFaultError when it is no LEC."""
        self.motion()
        self._set(self._at.coil_serial_mode, on=True)

    def status(self) -> LecStatus:
        """Ask for its outputs."""
        inputs = self._modbus.read_inputs(self._at.first_input, 8)
        return LecStatus(
            busy=inputs[self._at.input_busy],
            servo_ready=inputs[self._at.input_servo_ready],
            homed=inputs[self._at.input_homed],
            emergency_stop=inputs[self._at.input_emergency_stop],
            alarm=inputs[self._at.input_alarm] == self._at.alarm_level,
        )

    def motion(self) -> LecMotion:
        """Ask where it is and where it goes."""
        words = self._modbus.read_registers(self._at.present, 6)
        position, target = int32s([*words[:2], *words[4:]])
        return LecMotion(position, words[2], target)

    def begin_homing(self) -> None:
        """Return to origin, from the moment this is sent."""
        self.end_homing()
        self._set(self._at.coil_set_up, on=True)

    def end_homing(self) -> None:
        """Take the request for a return to origin back."""
        self._set(self._at.coil_set_up, on=False)

    def begin_move(self, target: int, *, speed_deg_s: int, acceleration_deg_s2: int) -> None:
        """Go to `target`, in 0.01 degrees, from the moment this is sent; `is_taken` tells whether it was accepted."""
        no_pushing, no_area = [0, 0, 0], [0, 0]
        self._modbus.write_registers(
            self._at.operation,
            [
                *(self._at.absolute_word, speed_deg_s, *words_of([target]), acceleration_deg_s2, acceleration_deg_s2),
                *(*no_pushing, _FULL_FORCE_PERCENT, *no_area, *no_area, *words_of([_IN_POSITION_WIDTH])),
            ],
        )
        self._modbus.write_registers(self._at.start, [self._at.start_word])

    def is_taken(self) -> bool:
        """Whether the controller has taken the move."""
        return self._modbus.read_registers(self._at.start, 1) == [0]

    def hold(self) -> None:
        """Stop with the set deceleration; the motion is kept, and would go on without the hold."""
        self._set(self._at.coil_hold, on=True)

    def is_held(self) -> bool:
        """Whether it is told to hold."""
        return self._modbus.read_coils(self._at.coil_hold, 1)[0]

    def end_hold(self) -> bool:
        """Take the hold back, so that nothing moves; returns whether a motion was kept, which is then given up.

        With the servo off there is no motion that the end of the hold could resume.
        """
        is_kept = self._may_resume()
        if is_kept:
            self._switch_servo(on=False)
            self.end_homing()
        self._set(self._at.coil_hold, on=False)
        if is_kept:
            self.switch_servo_on()
        return is_kept

    def _may_resume(self) -> bool:
        motion = self.motion()
        is_there = abs(motion.position - motion.target) <= _REST and self.is_taken() and not self.status().busy
        return not is_there or self._modbus.read_coils(self._at.coil_set_up, 1)[0]

    def switch_servo_on(self) -> None:
        """Switch the servo on and wait for it; raises DeviceFaultError after 2 s."""
        self._switch_servo(on=True)

    def reset_alarm(self) -> None:
        """Reset an alarm and wait until it is gone; raises DeviceFaultError after 2 s."""
        self._set(self._at.coil_reset, on=True)
        self._set(self._at.coil_reset, on=False)
        self._wait(lambda: not self.status().alarm, "its alarm cannot be reset")

    def _switch_servo(self, *, on: bool) -> None:
        self._set(self._at.coil_servo_on, on=on)
        self._wait(lambda: self.status().servo_ready == on, f"its servo stays {'off' if on else 'on'}")

    def _set(self, coil: int, *, on: bool) -> None:
        self._modbus.write_coil(coil, on=on)

    def _wait(self, condition: Callable[[], bool], otherwise: str) -> None:
        deadline = Deadline(self._clock, _SWITCH_S)
        while not condition():
            if deadline.has_passed():
                raise DeviceFaultError(
                    self._name,
                    f"{otherwise} ({_SWITCH_S:g} s after it was told)",
                    not_done="nothing was moved",
                    to_do="read the alarm from the controller, remove its cause, and switch the controller off and on",
                )
            self._clock.sleep(_POLL_S)
