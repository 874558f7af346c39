"""Replies that lose parts, come in parts, come together, twice or not at all."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from sim_devices.faults.entry import Chunks, Random, ReplyFault


class Missing(ReplyFault):
    """Replies that never come."""

    fault: Literal["missing"] = Field(description="the fault's name")

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """Nothing."""
        return []


class Short(ReplyFault):
    """Replies that lose their last bytes."""

    fault: Literal["short"] = Field(description="the fault's name")
    lost_bytes: int = Field(default=1, ge=1, le=4096, description="how many bytes are lost at the end")

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """The beginning."""
        return [(due_s, reply[: -self.lost_bytes])]


class Split(ReplyFault):
    """Replies that come in two parts, cut anywhere."""

    fault: Literal["split"] = Field(description="the fault's name")
    apart_s: float = Field(default=0.05, gt=0, le=3600, description="time between the parts, in s")

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """Two parts."""
        cut = int(random.integers(0, len(reply) + 1))
        return [(due_s, reply[:cut]), (due_s + self.apart_s, reply[cut:])]


class Merged(ReplyFault):
    """Replies that wait for the next one and come together with it."""

    fault: Literal["merged"] = Field(description="the fault's name")

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """The reply, when there is another one."""
        return [(math.inf, reply)]


class Duplicated(ReplyFault):
    """Replies that come twice."""

    fault: Literal["duplicated"] = Field(description="the fault's name")

    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """Twice the reply."""
        return [(due_s, reply), (due_s, reply)]
