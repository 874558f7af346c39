"""Cameras that serve still pictures over HTTP, in a rig file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Literal, Self

from pydantic import Field, model_validator

from acquisition.section import SectionFault, refuse_all
from drivers.camera.still_settings import STILL, StillSettings
from goniometer.rig_devices.camera import CameraEntry
from goniometer.rig_devices.connecting import Connecting
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.http_camera import HttpCameraDevice

_LOGGED_BYTES = 1024
"""Of an answer: its headers, and how its picture begins."""

_SAME_LENS = 0.05

_PATH = re.compile(r"/[!-~]*")


class HttpCameraEntry(CameraEntry):
    """Camera that serves still pictures, as PNG or TIFF, over HTTP."""

    driver: Literal["http_camera"] = Field(description="the device's family")
    still: str = Field(
        default=STILL,
        max_length=1000,
        description="path of a picture at the camera's address, with {exposure_s}, {gain_db} and {bits} in it",
    )

    @model_validator(mode="after")
    def _check_address(self) -> Self:
        refuse_all(self._address_faults())
        return self

    def _address_faults(self) -> Iterator[SectionFault]:
        if not self.port.startswith("http://") and self.port != "simulated":
            yield ("port",), f"got {self.port!r}; allowed: the camera's address such as http://192.168.0.20:80"
        try:
            is_path = _PATH.fullmatch(self._settings.path(1.0)) is not None
        except (LookupError, ValueError, AttributeError):
            is_path = False
        if not is_path or "{exposure_s}" not in self.still:
            yield (
                ("still",),
                f"got {self.still!r}; allowed: a path that begins with / and has {{exposure_s}} in it, such as {STILL}",
            )
        elif "{gain_db}" not in self.still and self.gain_db != 0.0:
            yield (
                ("still",),
                f"got {self.still!r}, which does not tell the camera gain_db, {self.gain_db:g}; allowed: a path with "
                "{gain_db} in it, or gain_db 0 with watts_per_count_per_s and sensor at the gain that the camera has",
            )

    @property
    def _settings(self) -> StillSettings:
        return StillSettings(
            self.width_px,
            self.height_px,
            self.bits,
            gain_db=self.gain_db,
            still=self.still,
            exposure_step_s=self.sample_s,
            readout_s=self.readout_s,
            warm_up_frames=self.warm_up_frames,
        )

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether the pictures are of one size, the depth is one that it has, and the lens is the same one.

        A lens may be known wrongly, which is worth simulating; beyond 5 % it is another one.
        """
        assert isinstance(simulated, HttpCameraDevice)
        for key in ("width_px", "height_px"):
            if (there := getattr(simulated, key)) != (held := getattr(self, key)):
                yield (key,), f"got {there}; allowed: {held}"
        if self.bits not in simulated.bits:
            yield ("bits",), f"has no {self.bits}; allowed: {self.bits} among them"
        if self.optics is None:
            return
        view, (column, row) = simulated.view(), self.optics.centre_px
        if not math.isclose(view.focal_px, self.optics.focal_px, rel_tol=_SAME_LENS):
            yield ("focal_px",), f"got {view.focal_px:g}; allowed: about {self.optics.focal_px:g}"
        if max(abs(view.centre_px[0] - column), abs(view.centre_px[1] - row)) > _SAME_LENS * self.width_px:
            yield ("centre_px",), f"got {list(view.centre_px)}; allowed: about {[column, row]}"

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the camera and take its first pictures."""
        from drivers.camera.installed import camera_package

        for module in ("h11", "cv2"):
            camera_package(module)
        from drivers.camera.http_still import HttpStillCamera

        camera = HttpStillCamera(
            bench.link(name, most_logged=_LOGGED_BYTES),
            bench.clock,
            photometer=self.photometer(name),
            settings=self._settings,
        )
        bench.add(name, camera)
        bench.detectors[name] = camera
