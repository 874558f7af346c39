"""Bytes that nobody asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.device import Due
from sim_devices.faults.entry import DeviceFault, Random

if TYPE_CHECKING:
    from sim_devices.faults.switchboard import Switchboard

_CHUNK_BYTES, _CHUNK_S = 512, 0.01
_FIRST_PRINTABLE, _BEHIND_PRINTABLE = 0x20, 0x7F


class Noise(DeviceFault):
    """Random bytes between frames."""

    fault: Literal["noise"] = Field(description="the fault's name")
    noise_bytes: int = Field(default=5, ge=1, le=65536, description="how many bytes")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Let every client hear it."""
        board.say(self.device, random.bytes(self.noise_bytes))


class StrayPrompt(DeviceFault):
    """A prompt, or another end of an answer, without an answer."""

    fault: Literal["stray_prompt"] = Field(description="the fault's name")
    text: str = Field(default="> ", min_length=1, max_length=256, description="what is said")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Let every client hear it."""
        board.say(self.device, self.text.encode())


class EndlessOutput(DeviceFault):
    """Printable characters without an end of line, for as long as the fault lasts."""

    fault: Literal["endless_output"] = Field(description="the fault's name")
    for_s: float = Field(default=10.0, gt=0, le=1e6, description="how long it lasts, in s")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Say more and more of it."""

        def go_on(now_s: float) -> list[Due]:
            board.say(self.device, bytes(random.integers(_FIRST_PRINTABLE, _BEHIND_PRINTABLE, _CHUNK_BYTES, "uint8")))
            return [(now_s + _CHUNK_S, go_on)] if now_s < time_s + self.for_s else []

        board.follow(time_s, go_on)
