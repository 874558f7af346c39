"""Where things are in an SMC LEC controller, and what its firmwares do not agree on."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LecRegisters:
    """Addresses of coils, inputs and holding registers, and what differs between firmwares."""

    coil_hold: int = 0x18
    coil_servo_on: int = 0x19
    coil_reset: int = 0x1B
    coil_set_up: int = 0x1C
    coil_serial_mode: int = 0x30

    first_input: int = 0x48  # of eight; the numbers of the inputs below count from it
    input_busy: int = 0
    input_servo_ready: int = 1
    input_homed: int = 2
    input_emergency_stop: int = 6
    input_alarm: int = 7

    present: int = 0x9000  # position (two registers), speed, thrust, target (two registers)
    start: int = 0x9100  # 0 again once the controller has taken it
    operation: int = 0x9102  # sixteen registers, from the mode to the in-position width

    start_word: int = 0x0100
    absolute_word: int = 0x0001
    alarm_level: bool = True
