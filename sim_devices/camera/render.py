"""Pictures of a plate: the Stokes parameters that every pixel of a camera sees."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.mueller import UNPOLARIZED
from model.stokes import require_stokes
from sim_devices.camera.coverage import coverage
from sim_devices.camera.layers import Boxes, FloatArray
from sim_devices.camera.layout import Lambertian, Layout, Rough
from sim_devices.camera.mapped_surface import MappedSurface
from sim_devices.camera.view import View

Scattered = Callable[[float, FloatArray, FloatArray, Boxes], NDArray[np.floating]]
"""Stokes vectors (N, 4) from the incidence, exits and azimuths (N,) in radians, and the boxes that pixels see."""


class Renderer:
    """What a camera sees of a plate in light of one wavelength.

    Parameters
    ----------
    layout : Layout
        The plate.
    view : View
        The camera.
    wavelength_nm : float
        Of the light.
    lamp_stokes : array_like
        Stokes vector of the lamp's light, (4,), in the frame of the incoming ray; unpolarized by default.

    Raises
    ------
    ConfigurationError
        If a material is not known at the wavelength.
    """

    def __init__(self, layout: Layout, view: View, wavelength_nm: float, lamp_stokes: ArrayLike = UNPOLARIZED) -> None:
        self.layout, self.view = layout, view
        self._lamp = require_stokes(lamp_stokes)
        self._scattered = [
            None if isinstance(ink, Lambertian) else self._surface(ink, wavelength_nm) for ink in layout.inks
        ]
        self._last: tuple[tuple[float, float, float], NDArray[np.float32]] | None = None
        # compiles the surfaces now, before the camera has to answer in time
        for scattered in self._scattered:
            if scattered is not None:
                scattered(0.0, np.zeros(1), np.zeros(1), Boxes(*np.zeros((4, 1))))

    def stokes(self, incidence_deg: float, exit_deg: float, azimuth_deg: float) -> NDArray[np.float32]:
        """The picture, F times the lamp's Stokes vector, the mean over the area of each pixel.

        Edges of materials lie where they should to a hundredth of a pixel; a material's light is that in the direction
        of the pixel's centre.

        Parameters
        ----------
        incidence_deg, exit_deg : float
            Where the arms stand; a positive exit is opposite to a positive incidence.
        azimuth_deg : float
            How far the plate is turned about its normal, right-handed.

        Returns
        -------
        ndarray
            (4, height, width) in 1/sr, without cosines, read-only; darkness where the lamp or the camera is below the
            plate. The frame is that of the camera: x to the right in the picture, made perpendicular to each ray, and
            y up. For the same angles again it is the same array.
        """
        place = (incidence_deg, exit_deg, azimuth_deg)
        if self._last is None or self._last[0] != place:
            picture = self._picture(math.remainder(incidence_deg, 360), math.remainder(exit_deg, 360), azimuth_deg)
            picture.flags.writeable = False
            self._last = place, picture
        return self._last[1]

    def _picture(self, incidence_deg: float, exit_deg: float, azimuth_deg: float) -> NDArray[np.float32]:
        view = self.view
        picture = np.zeros((4, view.height * view.width))
        if abs(incidence_deg) >= 90 or abs(exit_deg) >= 90:
            return picture.reshape(4, view.height, view.width).astype(np.float32)
        boxes, directions = view.boxes(exit_deg, azimuth_deg), view.directions(exit_deg)
        exit_rad = directions.exit_rad.ravel()
        azimuth_rad = directions.azimuth_rad.ravel() + (math.pi if incidence_deg < 0 else 0.0)
        seen = coverage(self.layout, view, boxes, exit_deg, azimuth_deg)
        for number, (ink, scattered) in enumerate(zip(self.layout.inks, self._scattered, strict=True)):
            pixels, shares = seen.of(number)
            if isinstance(ink, Lambertian):
                picture[0, pixels] += shares * (ink.albedo / math.pi * self._lamp[0])
            elif scattered is not None and len(pixels):
                light = scattered(
                    math.radians(abs(incidence_deg)), exit_rad[pixels], azimuth_rad[pixels], boxes.some(pixels)
                )
                picture[:, pixels] += shares * light.T
        return directions.in_camera_frame(picture.reshape(4, view.height, view.width)).astype(np.float32)

    def _surface(self, ink: Rough, wavelength_nm: float) -> Scattered:
        if ink.mapped:
            assert self.layout.roughness is not None
            mapped = MappedSurface(ink.sample, self.layout.roughness, wavelength_nm)
            return lambda incidence, exit_, azimuth, boxes: mapped.stokes(incidence, exit_, azimuth, boxes, self._lamp)
        surface = ink.sample.surface(wavelength_nm)
        return lambda incidence, exit_, azimuth, _: surface.stokes(incidence, exit_, azimuth, self._lamp)
