"""What a camera's optics add to the picture of a perfect lens, each a part that a scene may name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sim_devices.camera.view import View
from sim_devices.scene_part import ScenePart

Picture = NDArray[np.float32]
"""(…, height, width), of any quantity that is linear in the light."""

_LOBES = 8
_KAISER = 7.0
_ROUNDS = 100


class Blur(ScenePart):
    """The picture of a point is a Gaussian, as pixels have it."""

    effect: Literal["blur"]
    sigma_px: float = Field(ge=0.2, le=50, description="its standard deviation along rows and columns")

    def on(self, picture: Picture, view: View) -> Picture:
        """The blurred picture; beyond its edges it is taken to be its own mirror image, so that no light is lost."""
        kernel = _gaussian(self.sigma_px)
        return _filtered(picture, kernel, kernel)


class Vignetting(ScenePart):
    """Less light arrives off the axis: cos^4 of the angle to it, or as a polynomial says."""

    effect: Literal["vignetting"]
    polynomial: Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=8)] | None = Field(
        default=None,
        description="relative illumination 1 + a r² + b r⁴ + …, r the tangent of the field angle; without it cos⁴",
    )

    def on(self, picture: Picture, view: View) -> Picture:
        """The picture with its falling illumination."""
        return picture * self.relative(view)

    def relative(self, view: View) -> Picture:
        """Relative illumination, (height, width); 0 where a polynomial falls below it."""
        x, y = view.centres
        r2 = x * x + y * y
        if self.polynomial is None:
            return ((1.0 + r2) ** -2).astype(np.float32)
        return np.maximum(np.polynomial.polynomial.polyval(r2, (1.0, *self.polynomial)), 0.0).astype(np.float32)


class Wedge(ScenePart):
    """The polarizer's faces are not parallel: it moves the picture, in a direction that turns with it."""

    effect: Literal["wedge"]
    deviation_px: float = Field(ge=0, le=50, description="how far the picture moves")
    direction_deg: float = Field(
        ge=-360, le=360, description="whither at polarizer 0, counterclockwise from the picture's right"
    )

    def shift_px(self, polarizer_deg: float) -> tuple[float, float]:
        """How far the picture moves behind a polarizer at an angle, in columns (right) and rows (down)."""
        angle = math.radians(polarizer_deg + self.direction_deg)
        return self.deviation_px * math.cos(angle), -self.deviation_px * math.sin(angle)

    def on(self, picture: Picture, view: View, polarizer_deg: float) -> Picture:
        """The moved picture; what comes in over its edges is the picture's own mirror image."""
        columns, rows = self.shift_px(polarizer_deg)
        return _filtered(picture, _moving(columns), _moving(rows))


AnyOptics = Annotated[Blur | Vignetting | Wedge, Field(discriminator="effect")]


def seen_through(
    parts: Sequence[Blur | Vignetting | Wedge], picture: Picture, view: View, polarizer_deg: float | None = None
) -> Picture:
    """The picture after what the optics add, in the order in which light meets it: wedge, vignetting, blur.

    Parameters
    ----------
    parts : sequence
        What there is; without any the picture itself is returned.
    picture : ndarray
        (…, height, width).
    view : View
        The camera.
    polarizer_deg : float or None
        Where the polarizer stands; None without one, and then there is no wedge.
    """
    for part in sorted(parts, key=lambda part: (Wedge, Vignetting, Blur).index(type(part))):
        if not isinstance(part, Wedge):
            picture = part.on(picture, view)
        elif polarizer_deg is not None:
            picture = part.on(picture, view, polarizer_deg)
    return picture


def _gaussian(sigma_px: float) -> NDArray[np.float64]:
    """Taps of a Gaussian that is as much wider than `sigma_px` as makes their own variance that of `sigma_px`."""
    reach = math.ceil(5 * sigma_px) + 2
    distance2 = np.arange(-reach, reach + 1) ** 2.0
    variance = sigma_px**2
    for _ in range(_ROUNDS):
        taps = np.exp(-0.5 * distance2 / variance)
        variance += sigma_px**2 - float((taps * distance2).sum() / taps.sum())
    return np.asarray(taps)


def _moving(distance_px: float) -> NDArray[np.float64]:
    """Taps that move a row by any distance: a sinc in Kaiser's window, the middle tap that of distance 0."""
    reach = math.ceil(abs(distance_px)) + _LOBES
    from_centre = np.arange(-reach, reach + 1) - distance_px
    window = np.i0(_KAISER * np.sqrt(np.maximum(0.0, 1.0 - (from_centre / _LOBES) ** 2)))
    return np.where(np.abs(from_centre) < _LOBES, np.sinc(from_centre) * window, 0.0)


def _filtered(picture: Picture, across: NDArray[np.float64], down: NDArray[np.float64]) -> Picture:
    """The picture convolved with kernels along rows and columns, each brought to the sum 1."""
    import cv2

    planes = picture.reshape(-1, *picture.shape[-2:])
    # OpenCV correlates: a kernel the other way round makes it a convolution
    along, upright = ((kernel / kernel.sum())[::-1].copy() for kernel in (across, down))
    done = [cv2.sepFilter2D(plane, -1, along, upright, borderType=cv2.BORDER_REFLECT) for plane in planes]
    return np.stack(done).reshape(picture.shape)
