"""A polarization state generator in a rig file: a polarizer, and perhaps a retarder behind it, in the source arm."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from drivers.rotating_analyzer import RotatingAnalyzer
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import Role
from goniometer.rig_devices.rotating_polarizer import Element, RotatingPolarizerEntry

_ROLES: dict[Element, Role] = {"polarizer": "generator_polarizer", "retarder": "generator_retarder"}


class RotatingGeneratorEntry(RotatingPolarizerEntry):
    """As a rotating analyzer, on rotators of its own; the light passes the polarizer first, and then the retarder."""

    part: ClassVar[str] = "generator"

    driver: Literal["rotating_generator"] = Field(description="the generator's kind")  # type: ignore[assignment]

    def role(self, element: Element) -> Role:
        """The axis that turns an element."""
        return _ROLES[element]

    def give(self, name: str, bench: Connecting, driven: RotatingAnalyzer) -> None:
        """Take the connected device's place on the bench."""
        bench.generators[name] = driven
