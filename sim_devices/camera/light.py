"""The light on the pixels of a simulated camera: the plate as it lies there, through everything that the bench has."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sim_devices.camera.layout import Layout
from sim_devices.camera.optics import AnyOptics, seen_through
from sim_devices.camera.render import Renderer
from sim_devices.camera.sensor import Image
from sim_devices.camera.view import View
from sim_devices.effects.measurement import Moment, Stokes, Trial

if TYPE_CHECKING:
    from sim_devices.world import World

Cover: TypeAlias = Callable[[Layout], Layout]
"""Something that lies on the plate for a while."""


class PlateLight:
    """What the plate sends through analyzer and lens, where arms and analyzer are in the middle of an exposure.

    Each pixel sees lamp · share · cos(incidence) · acceptance · (row · Stokes in 1/sr), without the cosine of the exit
    angle, because the lit spot is larger than the picture.

    Parameters
    ----------
    world : World
        The bench, whole before the first picture.
    view : View
        Where the camera looks.
    lens : sequence of AnyOptics
        What the lens and the polarizer do to pictures.
    pixel_share : float
        Share of the beam that falls, at normal incidence, on what a pixel sees from straight above.
    """

    def __init__(self, world: World, view: View, lens: Sequence[AnyOptics], pixel_share: float) -> None:
        self._world, self._view, self._lens, self._pixel_share = world, view, tuple(lens), pixel_share
        self._covers: list[Cover] = []
        self._renderers: dict[float, Renderer] = {}

    def cover(self, cover: Cover) -> None:
        """Lay something on the plate, upon all that lies there."""
        self._covers.append(cover)
        self.look()

    def uncover(self, cover: Cover) -> None:
        """Take it away again."""
        self._covers.remove(cover)
        self.look()

    def look(self) -> None:
        """Take in what lies on the plate."""
        scene = self._world.scene
        assert scene.plate is not None, "a scene with a camera is only accepted with it"
        layout = scene.plate.load(self._world.folder, scene.sample)
        for cover in self._covers:
            layout = cover(layout)
        self._renderers = {
            wavelength_nm: Renderer(layout, self._view, wavelength_nm, self._world.lamp_stokes)
            for wavelength_nm in scene.wavelengths_nm()
        }

    def power_w(self, moment: Moment) -> Image | None:
        """Mean power on each pixel over an exposure, (height, width); None in the dark."""
        world, time_s = self._world, moment.middle_s
        row = world.mean_row(moment)
        if row is None:
            return None
        added, made = self._way(moment)
        incidence_deg = world.angle_deg["source_arm"](time_s)
        seen_w = self._pixel_share * self._lamp_w(time_s) * max(0.0, math.cos(math.radians(incidence_deg)))
        # of the stack's own kind, which is not copied then
        seen_by = (seen_w * world.acceptance_sr * (row @ made)).astype(np.float32)
        picture = np.tensordot(seen_by, self._stokes(time_s), 1) + np.float32(self._pixel_share * (row @ added))
        seen = seen_through(self._lens, picture, self._view, world.analyzer.polarizer_deg(time_s))
        return np.maximum(seen, 0.0, dtype=np.float64)

    def _way(self, moment: Moment) -> tuple[Stokes, Stokes]:
        """Light that joins that of the sample before the analyzer, (4,), and what becomes of the sample's, (4, 4)."""
        arriving_w = self._world.arriving_w
        added = arriving_w(Trial(moment, np.zeros(4)))
        made = np.stack([arriving_w(Trial(moment, unit)) - added for unit in np.eye(4)], axis=1)
        return added, made

    def _lamp_w(self, time_s: float) -> float:
        """The beam's power, behind the filter."""
        filters = self._world.filters
        passed = None if filters is None else filters.in_beam(time_s)
        share = 1.0 if filters is None else 0.0 if passed is None else passed.transmission
        return self._world.scene.lamp.power_w * share

    def _stokes(self, time_s: float) -> NDArray[np.float32]:
        """As seen by the camera where the arms are, (4, height, width), in 1/sr."""
        angles_deg = (self._world.angle_deg[role](time_s) for role in ("source_arm", "detector_arm", "sample_azimuth"))
        # a stage that is homed over its switch may count whole turns
        within_deg = (math.remainder(angle_deg, 360.0) for angle_deg in angles_deg)
        return self._renderers[self._world.wavelength_nm(time_s)].stokes(*within_deg)
