"""How the plate stands before the camera, from the markers in a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition.imaging.place.arms import Arms
from acquisition.imaging.place.holder import FEWEST_MARKERS
from acquisition.imaging.place.markers import Seen, Sighting
from acquisition.imaging.place.optics import Optics
from goniometer.errors import ReductionError

_FEWEST_CORNERS = 4 * FEWEST_MARKERS
_MOST_NAMED = 8
_OUTLIER_PX = 1.5
_RESIDUAL_PX = 0.7
"""A corner farther than this from where the pose has it was not found well: noise and blur account for 0.3 px."""


@dataclass(frozen=True, eq=False)
class Pose:
    """From plate to camera: a point (x, y, 0) in mm lies at rotation · (x, y, 0) + translation, z ahead.

    Parameters
    ----------
    rotation : ndarray
        (3, 3), rows are the camera's axes in plate coordinates.
    translation_mm : ndarray
        (3,): the plate's origin as the camera has it.
    residual_px : float
        Root mean square distance between corners as found and as the pose has them.
    used : int
        How many markers it rests on; of a board, how many of its corners.
    notes : tuple of str
        What was not found, or left out, and why.
    """

    rotation: NDArray[np.float64]
    translation_mm: NDArray[np.float64]
    residual_px: float = 0.0
    used: int = 0
    notes: tuple[str, ...] = ()

    @property
    def camera_mm(self) -> NDArray[np.float64]:
        """(3,): where the camera stands, in plate coordinates."""
        return np.asarray(-self.rotation.T @ self.translation_mm)

    @property
    def exit_deg(self) -> float:
        """Signed, of the camera's optical axis, as `Arms` counts it."""
        return math.degrees(math.atan2(-self.rotation[1, 2], -self.rotation[2, 2]))

    @property
    def azimuth_deg(self) -> float:
        """By how much the plate is turned against the camera's upright, right-handed about the plate's normal."""
        return math.degrees(math.atan2(-self.rotation[0, 1], self.rotation[0, 0]))

    @property
    def sideways_deg(self) -> float:
        """By how much the optical axis leans out of the plane in which the arm moves."""
        return math.degrees(math.asin(max(-1.0, min(1.0, float(self.rotation[0, 2])))))

    def pixels(self, x_mm: ArrayLike, y_mm: ArrayLike, optics: Optics) -> NDArray[np.float64]:
        """Where points of the plate appear, (..., 2), column and row; NaN behind the camera."""
        x, y = np.broadcast_arrays(np.asarray(x_mm, np.float64), np.asarray(y_mm, np.float64))
        across, down, ahead = (
            row[0] * x + row[1] * y + offset for row, offset in zip(self.rotation, self.translation_mm, strict=True)
        )
        ahead = np.where(ahead > 0.0, ahead, np.nan)
        across, down = across / ahead, down / ahead
        k1, k2, p1, p2, k3 = optics.distortion
        radius2 = across**2 + down**2
        radial = 1.0 + radius2 * (k1 + radius2 * (k2 + radius2 * k3))
        twice = 2.0 * across * down
        column = across * radial + p1 * twice + p2 * (radius2 + 2.0 * across**2)
        row = down * radial + p2 * twice + p1 * (radius2 + 2.0 * down**2)
        return np.asarray(np.stack((column, row), axis=-1) * optics.focal_px + np.array(optics.centre_px))


def pose(found: Seen, optics: Optics, arms: Arms, tolerance_deg: float = 2.0) -> Pose:
    """Fit the pose to all corners; leave out markers that contradict the others.

    Blur and the glow of white paper move the four corners of a marker inwards or outwards alike, so that the sum over
    them stays.

    Parameters
    ----------
    found : Seen
        In the picture.
    optics : Optics
        The camera's.
    arms : Arms
        Where they say that the camera stands.
    tolerance_deg : float
        By how much the pose may deviate from that, in exit angle, azimuth and sideways.

    Raises
    ------
    ReductionError
        When too few markers were found or agree, or the pose contradicts the arms.
    """
    sightings = list(found.sightings)
    _require_enough(sightings, found, "were found")
    consistent = _consistent(sightings, optics)
    notes = _not_found(found)
    while True:
        left_out = [one for one in sightings if one not in consistent]
        _require_enough(consistent, found, "agree with each other", left_out)
        rotation, translation = _fitted(consistent, optics, arms)
        fitted = Pose(rotation, translation)
        misses = [_misses(one, fitted, optics) for one in consistent]
        worst = max(range(len(misses)), key=lambda place: float(misses[place].max()))
        if misses[worst].max() <= _RESIDUAL_PX:
            break
        consistent = [one for place, one in enumerate(consistent) if place != worst]
    for one in left_out:
        notes.append(f"{one.name} left out: {_misses(one, fitted, optics).max():.1f} px from where the others have it")
    result = Pose(rotation, translation, _residual(consistent, fitted, optics), len(consistent), tuple(notes))
    _require_arms(result, consistent, optics, arms, tolerance_deg)
    return result


def _consistent(sightings: Sequence[Sighting], optics: Optics) -> list[Sighting]:
    """The largest set of corners that one homography explains, and of them the markers that belong to it wholly."""
    import cv2

    flat = _undistorted(np.concatenate([one.pixels for one in sightings]), optics)
    plate = np.concatenate([one.plate_mm for one in sightings])
    _, inliers = cv2.findHomography(plate, flat, cv2.RANSAC, _OUTLIER_PX, maxIters=4000, confidence=0.9999)
    if inliers is None:
        return []
    ends = np.cumsum([len(one.plate_mm) for one in sightings])[:-1]
    return [one for one, good in zip(sightings, np.split(inliers.ravel(), ends), strict=True) if good.all()]


def _fitted(sightings: Sequence[Sighting], optics: Optics, arms: Arms) -> tuple[Any, Any]:
    """Of the two poses that a plane has in a picture, that with the smaller residual, or if alike that of the arms."""
    import cv2

    plate = np.concatenate([one.plate_mm for one in sightings])
    plate = np.column_stack((plate, np.zeros(len(plate))))
    pixels = np.concatenate([one.pixels for one in sightings])
    camera, distortion = optics.matrix, np.array(optics.distortion)
    _, turns, shifts, _ = cv2.solvePnPGeneric(plate, pixels, camera, distortion, flags=cv2.SOLVEPNP_IPPE)
    candidates = []
    for turn, shift in zip(turns, shifts, strict=True):
        turn, shift = cv2.solvePnPRefineLM(plate, pixels, camera, distortion, turn, shift)
        rotation = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
        shift = np.asarray(shift, np.float64).ravel()
        fitted = Pose(rotation, shift)
        apart = float(np.trace(rotation.T @ arms.rotation()))
        candidates.append((_residual(sightings, fitted, optics), -apart, rotation, shift))
    least = min(candidate[0] for candidate in candidates)
    alike = [candidate for candidate in candidates if _is_alike(candidate[0], least)]
    _, _, rotation, translation = min(alike, key=lambda candidate: candidate[1])
    return rotation, translation


def _undistorted(pixels: Any, optics: Optics) -> Any:
    import cv2

    camera = optics.matrix
    return cv2.undistortPoints(pixels[:, None], camera, np.array(optics.distortion), P=camera).reshape(-1, 2)


def _misses(one: Sighting, fitted: Pose, optics: Optics) -> NDArray[np.float64]:
    where = fitted.pixels(one.plate_mm[:, 0], one.plate_mm[:, 1], optics)
    return np.asarray(np.linalg.norm(where - one.pixels, axis=1))


def _not_found(found: Seen) -> list[str]:
    """What the pose has to do without: it is less certain then, most of all if all that is left lies on one side."""
    if not found.missing:
        return []
    listed = ", ".join(found.missing[:_MOST_NAMED]) + (", …" if len(found.missing) > _MOST_NAMED else "")
    others = f"; read, but not on the holder: {', '.join(map(str, found.strangers))}" if found.strangers else ""
    return [f"not found: {listed}{others}"]


def _residual(sightings: Sequence[Sighting], fitted: Pose, optics: Optics) -> float:
    misses = np.concatenate([_misses(one, fitted, optics) for one in sightings])
    return float(np.sqrt(np.mean(misses**2)))


def _is_alike(residual_px: float, least_px: float) -> bool:
    return residual_px <= 1.5 * least_px + 0.02


def _require_enough(sightings: Sequence[Sighting], found: Seen, what: str, left_out: Sequence[Sighting] = ()) -> None:
    if sum(len(one.plate_mm) for one in sightings) >= _FEWEST_CORNERS:
        return
    there = ", ".join(one.name for one in sightings) or "none"
    needed = f"needed are {FEWEST_MARKERS}, or {_FEWEST_CORNERS} corners of a board"
    parts = [f"Too few of the holder's markers {what}: {there}; {needed}"]
    if left_out:
        parts.append(f"contradicting: {', '.join(one.name for one in left_out)}")
    if found.missing:
        parts.append(f"not found: {', '.join(found.missing)}")
    if found.strangers:
        parts.append(f"read, but not on the holder: {', '.join(map(str, found.strangers))}")
    raise ReductionError(
        f"{'; '.join(parts)}. This direction has no map. Uncover the markers, bring them wholly into the picture, "
        "light and focus them, see that they are not saturated, and compare `markers`, `marker_mm` and `dictionary` "
        "with the holder."
    )


def _on_arm(found: Pose, sightings: Sequence[Sighting], optics: Optics, arms: Arms) -> Pose:
    """The corners' pose if the camera has no other tilt than the arms say; where the plate lies is fitted."""
    rotation = replace(arms, azimuth_deg=found.azimuth_deg, exit_azimuth_deg=0.0).rotation()
    plate = np.concatenate([one.plate_mm for one in sightings])
    turned = plate @ rotation[:, :2].T
    flat = _undistorted(np.concatenate([one.pixels for one in sightings]), optics)
    rays = (flat - np.array(optics.centre_px)) / optics.focal_px
    # A corner lies along its ray: two equations, linear in the translation.
    ones, zeros = np.ones(len(rays)), np.zeros(len(rays))
    across = np.column_stack((ones, zeros, -rays[:, 0]))
    down = np.column_stack((zeros, ones, -rays[:, 1]))
    wanted = rays * turned[:, 2:] - turned[:, :2]
    translation = np.linalg.lstsq(np.concatenate((across, down)), wanted.T.ravel(), rcond=None)[0]
    return Pose(rotation, translation)


def _require_arms(found: Pose, sightings: Sequence[Sighting], optics: Optics, arms: Arms, tolerance_deg: float) -> None:
    """Refuse a pose that contradicts the arms.

    Near the normal and from far away a tilt hardly moves the corners: it contradicts only where they lie worse without.
    """
    turned_deg = arms.azimuth_deg - arms.exit_azimuth_deg
    compared = [("azimuth against the camera", found.azimuth_deg, turned_deg)]
    on_arm = _residual(sightings, _on_arm(found, sightings, optics, arms), optics)
    if not _is_alike(on_arm, found.residual_px):
        compared += [("exit angle", found.exit_deg, arms.exit_deg), ("lean sideways", found.sideways_deg, 0.0)]
    faults = [
        f"{name} {is_deg:.2f}° by the markers, {said_deg:.2f}° by the arms"
        for name, is_deg, said_deg in compared
        if abs((is_deg - said_deg + 180.0) % 360.0 - 180.0) > tolerance_deg
    ]
    if faults:
        raise ReductionError(
            f"Markers and arms contradict each other by more than {tolerance_deg:g}°: {'; '.join(faults)}. This "
            "direction has no map. Home the arms, and check how camera and holder are mounted, the markers' places and "
            "`focal_px`."
        )
