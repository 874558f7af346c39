"""Thorlabs APT controllers in a rig file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Literal, Self

from pydantic import Field, model_validator

from acquisition.section import SectionFault, refuse_all
from drivers.thorlabs_apt.port import AptPort
from drivers.thorlabs_apt.stage import ThorlabsApt
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AxesEntry, AxisEntry, HomeOffset, Role
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.thorlabs_apt import ThorlabsAptDevice


class ThorlabsAptAxis(AxisEntry):
    """One stage of an APT controller."""

    bay: int | None = Field(default=None, ge=1, le=3, description="bay of a BSC20x rack; leave it out for other units")
    home_offset_deg: HomeOffset = None


class ThorlabsAptEntry(AxesEntry):
    """Thorlabs K10CR1, KDC101 with PRM1Z8, KBD101 with DDR100 or DDR25, or a BSC20x rack with HDR50 tables."""

    driver: Literal["thorlabs_apt"] = Field(description="the device's family")
    stage: Literal["K10CR1", "HDR50", "PRM1Z8", "DDR100", "DDR25"] = Field(description="model of the stages")
    axes: dict[Role, ThorlabsAptAxis] = Field(min_length=1, description="the stages, by role")

    @model_validator(mode="after")
    def _check_bays(self) -> Self:
        bays = Counter(axis.bay for axis in self.axes.values())
        refuse_all(
            (("axes", role, "bay"), f"got {axis.bay or 'none'}, which another stage has too; allowed: one stage a bay")
            for role, axis in self.axes.items()
            if bays[axis.bay] > 1
        )
        return self

    exchange_s = 0.005
    start_s = 0.014

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the controller's stages."""
        port = AptPort(bench.link(name, rtscts=True), bench.clock)
        for role, axis in self.axes.items():
            stage = ThorlabsApt(
                port,
                self.stage,
                name=role,
                velocity_deg_s=axis.velocity_deg_s,
                acceleration_deg_s2=axis.acceleration_deg_s2,
                bay=axis.bay,
                home_offset_deg=axis.home_offset_deg,
            )
            bench.add_axis(name, role, stage, axis.travel)

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether the stages are of one model and turn the same."""
        assert isinstance(simulated, ThorlabsAptDevice)
        if simulated.stage != self.stage:
            yield ("stage",), f"got {simulated.stage}; allowed: {self.stage}"
        expected = {axis.bay or 1: role for role, axis in self.axes.items()}
        if simulated.axes != expected:
            wanted = ", ".join(f"{bay}: {role}" for bay, role in sorted(expected.items()))
            yield ("axes",), f"are others; allowed: {{{wanted}}}"
