"""Newport ESP300 and ESP301 in a rig file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Literal, Self

from pydantic import Field, model_validator

from acquisition.section import SectionFault, refuse_all
from drivers.newport_esp301.stage import NewportEsp301
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AxesEntry, AxisEntry, Role
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.newport_esp301 import NewportEsp301Device


class NewportEsp301Axis(AxisEntry):
    """One axis of a Newport ESP301."""

    axis: int = Field(ge=1, le=3, description="number of the axis on the controller's back")


class NewportEsp301Entry(AxesEntry):
    """Newport ESP301 (or ESP300) motion controller with one to three rotation stages."""

    driver: Literal["newport_esp301"] = Field(description="the device's family")
    baudrate: Literal[19200, 921600] = Field(
        default=19200, description="19200 on RS-232, 921600 on the ESP301's USB; without effect on a socket"
    )
    axes: dict[Role, NewportEsp301Axis] = Field(min_length=1, description="the controller's axes, by role")

    @model_validator(mode="after")
    def _check_axes(self) -> Self:
        numbers = Counter(axis.axis for axis in self.axes.values())
        refuse_all(
            (("axes", role, "axis"), f"got {axis.axis}, which another axis of this controller has too")
            for role, axis in self.axes.items()
            if numbers[axis.axis] > 1
        )
        return self

    exchange_s = 0.008
    start_s = 0.001

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the controller, then each of its stages."""
        link = bench.link(name, baudrate=self.baudrate, rtscts=True)
        controller = NewportEsp301(link, bench.clock)
        bench.add(name, controller)
        for role, axis in self.axes.items():
            stage = controller.stage(
                axis.axis,
                name=role,
                velocity_deg_s=axis.velocity_deg_s,
                acceleration_deg_s2=axis.acceleration_deg_s2,
            )
            bench.add_axis(name, role, stage, axis.travel)

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether the same axes turn the same arms."""
        assert isinstance(simulated, NewportEsp301Device)
        expected = {axis.axis: role for role, axis in self.axes.items()}
        if simulated.axes != expected:
            yield ("axes",), f"got {_in_words(simulated.axes)}; allowed: {_in_words(expected)}"


def _in_words(axes: Mapping[int, Role]) -> str:
    return f"{{{', '.join(f'{number}: {role}' for number, role in sorted(axes.items()))}}}"
