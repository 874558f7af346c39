"""Replies that come too late, or so slowly that nobody waits for their end."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from sim_devices.faults.entry import Chunks, Random, ReplyFault


class Late(ReplyFault):
    """Replies that come later; those behind them wait."""

    fault: Literal["late"] = Field(description="the fault's name")
    late_s: float = Field(gt=0, le=3600, description="how much later a reply comes, in s")

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """The reply, later."""
        return [(due_s + self.late_s, reply)]


class SlowDrip(ReplyFault):
    """Replies of which one byte a second comes."""

    fault: Literal["slow_drip"] = Field(description="the fault's name")
    byte_s: float = Field(default=1.0, gt=0, le=3600, description="time from byte to byte, in s")

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """Byte after byte."""
        return [(due_s + (place + 1) * self.byte_s, reply[place : place + 1]) for place in range(len(reply))]
