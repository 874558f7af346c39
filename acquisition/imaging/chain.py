"""From the pictures of one direction to its maps, by those steps alone that were asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.contradictions import lost_light
from acquisition.imaging.light.corrections import Corrections
from acquisition.imaging.light.signal_image import SignalImage
from acquisition.imaging.maps.direction_maps import DirectionMaps, PixelDirections
from acquisition.imaging.place.arms import Arms
from acquisition.imaging.place.exit_directions import exit_directions
from acquisition.imaging.place.holder import Holder
from acquisition.imaging.place.map_grid import MapGrid
from acquisition.imaging.place.markers import seen
from acquisition.imaging.place.optics import Optics
from acquisition.imaging.place.pose import Pose, pose
from acquisition.imaging.place.rectify import rectified
from acquisition.imaging.place.registration import Method, shifts
from acquisition.imaging.place.shift import shifted
from acquisition.imaging.stokes.pixel_values import outputs_of
from acquisition.imaging.stokes.signal_stokes import SignalStokes
from drivers.camera.frame import Frame
from goniometer.errors import ReductionError

_MUCH_SATURATED = 0.001
"""Share of a picture's pixels from which on it is worth a note that they were saturated."""


@dataclass(frozen=True)
class Taken:
    """The pictures of one direction.

    Parameters
    ----------
    point : int
        Which of the scan's directions.
    arms : Arms
        Where the arms stood.
    has_exit_azimuth : bool
        Whether the bench can turn the detector arm out of the plane of incidence.
    states : tuple
        The pictures behind each analyzer state.
    per_sr : tuple of float
        What turns counts per second at gain 0 dB into 1/sr, for each state.
    """

    point: int
    arms: Arms
    has_exit_azimuth: bool
    states: tuple[tuple[Frame, ...], ...]
    per_sr: tuple[float, ...]


@dataclass(frozen=True)
class OnSample:
    """What finds the sample's coordinates in a picture: markers on its holder, the lens, and the pixels of the maps."""

    holder: Holder
    optics: Optics
    grid: MapGrid


class Chain:
    """Makes maps of pictures, direction by direction.

    Parameters
    ----------
    corrections : Corrections
        From frames to light.
    inverse : ndarray
        (3 or 4, N): Stokes parameters from the light behind the N analyzer states.
    registration : {"phase", "ecc"}, optional
        How the shift of the picture from state to state is found; without it there is taken to be none.
    on_sample : OnSample, optional
        Where it is given, maps are in the sample's coordinates; else in the camera's pixels.
    """

    def __init__(
        self,
        corrections: Corrections,
        inverse: NDArray[np.float64],
        registration: Method | None = None,
        on_sample: OnSample | None = None,
    ) -> None:
        self._corrections, self._registration, self._on_sample = corrections, registration, on_sample
        self._rows = np.asarray(np.linalg.pinv(inverse), np.float64)
        self._stokes = SignalStokes(inverse, outputs_of(len(inverse)))

    def maps(self, taken: Taken) -> DirectionMaps:
        """The maps of one direction; empty ones, and a note why, where its pictures give none."""
        grid = None if self._on_sample is None else self._on_sample.grid
        try:
            return self._maps(taken, grid)
        except ReductionError as error:
            return without_maps(taken, grid, str(error))

    def _maps(self, taken: Taken, grid: MapGrid | None) -> DirectionMaps:
        images = [self._light(*of_state) for of_state in zip(taken.states, taken.per_sr, strict=True)]
        self._require_light(images)
        notes = [*dict.fromkeys(note for image in images for note in image.notes), *self._saturated(taken)]
        if not self._corrections.has_dark:
            notes.append(
                "there are no dark pictures: what a pixel counts in the dark beyond black_counts is light here"
            )
        shifts_px = [(0.0, 0.0)] * len(images)
        if self._registration is not None:
            found = shifts([image.signal for image in images], method=self._registration)
            shifts_px = [(float(column), float(row)) for column, row in found.shifts_px]
        if self._on_sample is None:
            in_place = [shifted(image, *shift_px) for image, shift_px in zip(images, shifts_px, strict=True)]
            return DirectionMaps(**_where(taken), grid=None, maps=self._stokes.maps(in_place), notes=tuple(notes))
        return self._on(self._on_sample, taken, images, shifts_px, tuple(notes))

    def _on(
        self,
        sample: OnSample,
        taken: Taken,
        images: Sequence[SignalImage],
        shifts_px: Sequence[tuple[float, float]],
        notes: tuple[str, ...],
    ) -> DirectionMaps:
        """Maps in the sample's coordinates; the markers are looked for in the light behind all states together."""
        in_place = (shifted(image, *shift_px).signal for image, shift_px in zip(images, shifts_px, strict=True))
        light = np.mean(list(in_place), axis=0)
        found = pose(seen(light, sample.holder, taken.arms.exit_deg), sample.optics, taken.arms)
        flat = [
            rectified(image, found, sample.optics, sample.grid, shift_px)
            for image, shift_px in zip(images, shifts_px, strict=True)
        ]
        if not any(np.isfinite(image.signal).any() for image in flat):
            raise ReductionError(
                "Nothing of the recipe's area is known in this picture: it lies outside, or is saturated. This "
                "direction has no map. Compare area with what the camera sees."
            )
        return DirectionMaps(
            **_where(taken),
            grid=sample.grid,
            maps=self._stokes.maps(flat),
            pixel_directions=_own_directions(found, sample.grid, taken.arms),
            noise_area_px=_noise_area_px(found, sample, light.shape),
            notes=(*notes, *found.notes),
        )

    def _light(self, frames: Sequence[Frame], per_sr: float) -> SignalImage:
        image = self._corrections.signal(frames)
        return SignalImage(image.signal * np.float32(per_sr), image.variance * np.float32(per_sr**2), image.notes)

    def _require_light(self, images: Sequence[SignalImage]) -> None:
        """Refuse pictures that are dark behind some states where the others say that there is light."""
        known = np.logical_and.reduce([np.isfinite(image.variance) for image in images])
        total = np.array([image.signal[known].sum(dtype=np.float64) for image in images])
        variance = np.array([image.variance[known].sum(dtype=np.float64) for image in images])
        lit = np.ones(len(images), np.bool_)
        if lost_light(self._rows, self._rows.shape[1], lit, total, variance):
            raise ReductionError(
                "Behind some of the analyzer's positions the picture is dark where the others say that there is light: "
                "a shutter was stuck, the lamp was off, or something in the beam. This direction has no map. Look at "
                "camera, lamp and beam, then measure it again."
            )

    def _saturated(self, taken: Taken) -> tuple[str, ...]:
        """A note on the pixels that are saturated in the shortest exposure of some state."""
        shortest = [min(frames, key=lambda frame: frame.exposure_s) for frames in taken.states]
        share = max(map(self._corrections.saturated_share, shortest))
        return (f"{share:.1%} of the pixels are saturated, and unknown",) if share >= _MUCH_SATURATED else ()


def without_maps(taken: Taken, grid: MapGrid | None, why: str) -> DirectionMaps:
    """What stands for a direction that has no maps."""
    return DirectionMaps(**_where(taken), grid=grid, notes=(why,))


def _where(taken: Taken) -> dict[str, Any]:
    arms = taken.arms
    return {
        "point": taken.point,
        "incidence_deg": arms.incidence_deg,
        "exit_deg": arms.exit_deg,
        "azimuth_deg": arms.azimuth_deg,
        "exit_azimuth_deg": arms.exit_azimuth_deg if taken.has_exit_azimuth else None,
    }


def _own_directions(found: Pose, grid: MapGrid, arms: Arms) -> PixelDirections:
    """In which directions the map's pixels are seen: the camera stands where its arm is, as far away as markers say.

    Near the normal the markers tell its angle to some 0.1° only, in which a smooth surface's light changes by percents.
    """
    distance_mm = float(np.linalg.norm(found.translation_mm))
    on_arm = Pose(arms.rotation(), np.array([0.0, 0.0, distance_mm]))
    own = exit_directions(on_arm, grid, arms.source())
    return PixelDirections.from_radians(own.exit_rad, own.azimuth_rad, own.to_exit_frame)


def _noise_area_px(found: Pose, sample: OnSample, shape: tuple[int, ...]) -> float:
    """Over how many map pixels noise is alike: a camera pixel's share in all of them, over the squares of its shares.

    A map pixel with the weights w of camera pixels has the variance sum w² of theirs, and shares noise with all others
    as far as these have the same camera pixels, whose weights in all map pixels add up to map pixels per camera pixel.
    """
    even = SignalImage(np.ones(shape, np.float32), np.ones(shape, np.float32))
    squares = np.nanmean(rectified(even, found, sample.optics, sample.grid).variance)
    grid = sample.grid
    x_mm, y_mm = grid.x_mm()[[0, -1]], grid.y_mm()[[0, -1]]
    corners = found.pixels(np.array([x_mm[0], x_mm[1], x_mm[0]]), np.array([y_mm[0], y_mm[0], y_mm[1]]), sample.optics)
    along, down = corners[1] - corners[0], corners[2] - corners[0]
    camera_px = abs(along[0] * down[1] - along[1] * down[0])
    map_px = max(grid.width - 1, 1) * max(grid.height - 1, 1)
    return max(1.0, float(map_px / camera_px / squares))
