"""GenICam cameras, in a rig file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from acquisition.section import SectionFault, refuse_all
from goniometer.rig_devices.camera import CameraEntry
from goniometer.rig_devices.connecting import Connecting


class GenicamCameraEntry(CameraEntry):
    """GenICam camera (GigE Vision, USB3 Vision, CoaXPress) behind its maker's transport library; not tried on one."""

    opened_by: ClassVar[str] = "its maker's transport library"

    driver: Literal["genicam_camera"] = Field(description="the device's family")
    port: Annotated[str, StringConstraints(min_length=1, max_length=100)] = Field(
        description="serial number of the camera, in quotes"
    )
    transport_library: str = Field(min_length=1, description="path of the .cti file that the camera's maker provides")
    bits: Literal[8, 10, 12, 14, 16] = Field(description="bits of a pixel, which the camera is set to: Mono8 to Mono16")

    @model_validator(mode="after")
    def _check_port(self) -> Self:
        refuse_all(self._port_faults())
        return self

    def _port_faults(self) -> Iterator[SectionFault]:
        if self.port == "simulated":
            yield ("port",), "got 'simulated', but there is no simulated GenICam camera; allowed: a serial number"

    def connect(self, name: str, bench: Connecting) -> None:
        """Open the camera, which stays set up, and waits for its trigger."""
        from drivers.camera.genicam import GenicamCamera

        camera = GenicamCamera(
            self.transport_library,
            bench.ports[name],
            bench.clock,
            self.photometer(name),
            size=(self.width_px, self.height_px),
            bits=self.bits,
            gain_db=self.gain_db,
            warm_up_frames=self.warm_up_frames,
        )
        bench.add(name, camera)
        bench.detectors[name] = camera
