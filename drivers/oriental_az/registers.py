"""Where things are in an Oriental Motor AZ drive: addresses of 32-bit items, bits as the factory sets them, alarms."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AzRegisters:
    """Addresses, each of the upper of two registers unless its name says low, and bits of the lower register."""

    direct_data: int = 0x0058  # eight items: data number, type, position, speed, two rates, current, trigger
    driver_input_low: int = 0x007D  # the lower register, which a write of one register reaches
    driver_output: int = 0x007E  # followed by the present alarm
    communication_error: int = 0x00AC
    command_position: int = 0x00C6
    feedback_position: int = 0x00CC
    alarm_reset: int = 0x0180  # resets when 1 follows 0

    input_return_home: int = 1 << 4
    input_stop: int = 1 << 5
    output_home_end: int = 1 << 4
    output_ready: int = 1 << 5
    output_move: int = 1 << 13
    output_in_position: int = 1 << 14


HOME_NOT_SET = 0x4A
ALARMS = {
    0x10: "position deviation",
    0x20: "over-current",
    0x21: "driver too hot",
    0x22: "over-voltage",
    0x25: "under-voltage",
    0x26: "motor too hot",
    0x28: "sensor error",
    0x30: "overload",
    0x31: "over-speed",
    HOME_NOT_SET: "home is not set",
    0x60: "both limit sensors active",
    0x66: "hardware over-travel",
    0x67: "software over-travel",
    0x70: "operation data error",
    0x85: "communication time-out",
}
COMMUNICATION_ERRORS = {
    0x00: "no communication error",
    0x84: "frame error",
    0x88: "undefined command",
    0x8C: "value out of range",
    0x8D: "command not executable",
}
