"""Replies with wrong bits in them, which a receiver without a checksum may not notice."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from sim_devices.bench_devices.entry import ModbusDevice, SimulatedDevice
from sim_devices.faults.entry import Chunks, Random, ReplyFault

_CHECKSUM_BYTES = 2


class Garbled(ReplyFault):
    """Replies in which bits are turned over, any of them."""

    fault: Literal["garbled"] = Field(description="the fault's name")
    bits: int = Field(default=1, ge=1, le=4096, description="how many bits of a reply are turned over")

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """The reply with wrong bits."""
        return [(due_s, _turned_over(reply, self.bits, random))]


class CrcError(ReplyFault):
    """Modbus replies whose checksum is wrong."""

    fault: Literal["crc_error"] = Field(description="the fault's name")

    def objections(self, devices: Mapping[str, SimulatedDevice]) -> tuple[str, ...]:
        """Say so where there is no checksum."""
        if found := super().objections(devices):
            return found
        device = devices[self.device]
        if isinstance(device, ModbusDevice) and device.framing == "rtu":
            return ()
        return (f"the fault {self.fault} needs a Modbus RTU device, and {self.device} is none",)

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """The reply with a wrong bit in its checksum."""
        body, checksum = reply[:-_CHECKSUM_BYTES], reply[-_CHECKSUM_BYTES:]
        return [(due_s, body + _turned_over(checksum, 1, random))]


def _turned_over(data: bytes, bits: int, random: Random) -> bytes:
    turned = bytearray(data)
    for bit in random.choice(8 * len(data), size=min(bits, 8 * len(data)), replace=False):
        turned[bit // 8] ^= 1 << bit % 8
    return bytes(turned)
