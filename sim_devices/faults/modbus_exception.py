"""A Modbus unit that refuses what it could do."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from sim_devices.bench_devices.entry import ModbusDevice, SimulatedDevice
from sim_devices.faults.entry import Chunks, Random, ReplyFault
from sim_devices.modbus.rtu import crc16

_SHORTEST = 5
_TCP_START, _TCP_UNIT = b"\0\0", 6


class ModbusException(ReplyFault):
    """Exceptions in place of replies; the requests themselves are carried out."""

    fault: Literal["modbus_exception"] = Field(description="the fault's name")
    code: int = Field(default=4, ge=1, le=11, description="exception code: 4 device failure, 6 busy")

    def objections(self, devices: Mapping[str, SimulatedDevice]) -> tuple[str, ...]:
        """Say so where no Modbus is spoken."""
        if found := super().objections(devices):
            return found
        if isinstance(devices[self.device], ModbusDevice):
            return ()
        return (f"the fault {self.fault} needs a Modbus device, and {self.device} is none",)

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """The frame of an exception, by a header as Modbus TCP has it or by a checksum.

        What another fault has left of a frame stays as it is.
        """
        if len(reply) < _SHORTEST:
            return [(due_s, reply)]
        if (
            reply[2:4] == _TCP_START
            and len(reply) > _TCP_UNIT + 1
            and len(reply) - _TCP_UNIT == struct.unpack_from(">H", reply, 4)[0]
        ):
            unit, function = reply[_TCP_UNIT], reply[_TCP_UNIT + 1]
            return [(due_s, reply[:4] + struct.pack(">HBBB", 3, unit, function | 0x80, self.code))]
        body = bytes((reply[0], reply[1] | 0x80, self.code))
        return [(due_s, body + crc16(body))]
