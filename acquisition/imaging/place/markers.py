"""The holder's markers in a picture."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.place.gaps import without_gaps
from acquisition.imaging.place.holder import Board, Holder

Points = NDArray[np.float64]

_LARGEST_STRETCH = 4.0
_WHITE_PERCENT = (99.5, 95.0, 80.0, 70.0, 60.0)
"""Tried one after the other: markers keep their contrast beside a glint that outshines them."""

_SEARCHES = ((1, 4), (2, 4), (1, 8))
"""How many times the picture is enlarged, and how finely a marker's cells are looked at then.

Those with a narrow margin beside a brighter plate are read in a larger picture alone. Finely only those are looked at
that are not read otherwise, because they lean where the sample is turned and foreshortened: then squares are taken for
markers that are not quite where these are.
"""

_DARKEST = 1e-3
"""Over the median: what is darker is black, so that noise does not take all steps of a logarithm."""

_REFINEMENTS = 5
_SETTLED_PX = 0.2
"""By how much the last refinement may still move an edge."""

_ALONG = np.concatenate((np.linspace(0.08, 0.49, 12), np.linspace(0.51, 0.92, 12)))
_ACROSS = np.linspace(-1.0, 1.0, 25)


@dataclass(frozen=True, eq=False)
class Sighting:
    """One marker, or one corner of a board's squares.

    Parameters
    ----------
    name : str
        What people call it, such as ``marker 3``.
    plate_mm : ndarray
        (corners, 2): where its corners lie on the plate.
    pixels : ndarray
        (corners, 2): where they were found, column and row.
    """

    name: str
    plate_mm: Points
    pixels: Points


@dataclass(frozen=True)
class Seen:
    """What was found in a picture.

    Parameters
    ----------
    sightings : tuple of Sighting
        A marker's number can occur twice: then one of the two was misread.
    missing : tuple of str
        What the holder bears and was not found.
    strangers : tuple of int
        Numbers that were read and are not on the holder.
    """

    sightings: tuple[Sighting, ...]
    missing: tuple[str, ...]
    strangers: tuple[int, ...]


def seen(picture: NDArray[np.floating], holder: Holder, exit_deg: float) -> Seen:
    """Find the holder's markers.

    The picture is first stretched vertically, by as much as the plate is foreshortened, because a marker whose cells
    are narrower than two pixels is not read. Its corners are then refined where the stretched picture's edges meet, in
    proportion to the light, not to its logarithm or the like, which would move the edges.

    Parameters
    ----------
    picture : ndarray
        (height, width), light in any unit; NaN where it is not known.
    holder : Holder
        What to look for.
    exit_deg : float
        As the arm says.
    """
    import cv2

    light, _ = without_gaps(np.asarray(picture, np.float32))
    upright = min(1.0 / max(math.cos(math.radians(exit_deg)), 1e-3), _LARGEST_STRETCH)
    height, width = light.shape
    stretched = cv2.resize(light, (width, round(height * upright)), interpolation=cv2.INTER_CUBIC)
    scale = np.array([1.0, len(stretched) / height])
    borne = _borne(holder)
    found: dict[str, list[Sighting]] = {}
    strangers: set[int] = set()
    for (larger, cell_px), gray in product(_SEARCHES, _grays(stretched)):
        sightings, others = _read(stretched, gray, holder, larger, cell_px)
        strangers.update(others)
        new: dict[str, list[Sighting]] = {}
        for one in sightings:
            new.setdefault(one.name, []).append(replace(one, pixels=(one.pixels + 0.5) / scale - 0.5))
        found = new | found
        if len(found) == len(borne):
            break
    return Seen(
        tuple(one for name in borne for one in found.get(name, [])),
        tuple(name for name in borne if name not in found),
        tuple(sorted(strangers)),
    )


def _read(
    light: Any, gray: NDArray[np.uint8], holder: Holder, larger: int, cell_px: int
) -> tuple[list[Sighting], set[int]]:
    """Markers and board corners in a stretched picture, and numbers that are not on the holder."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, holder.dictionary))
    reading = cv2.aruco.DetectorParameters()
    reading.minDistanceToBorder = larger  # of a black square, which a sample that turns carries to the picture's edge
    reading.perspectiveRemovePixelPerCell = cell_px
    sought = cv2.resize(gray, None, fx=larger, fy=larger, interpolation=cv2.INTER_CUBIC) if larger > 1 else gray
    quads, numbers, _ = cv2.aruco.ArucoDetector(dictionary, reading).detectMarkers(sought)
    quads = [np.asarray((quad + 0.5) / larger - 0.5, np.float32) for quad in quads]
    numbers = np.zeros((0, 1), np.int32) if numbers is None else numbers.reshape(-1, 1)
    read = [int(number) for number in numbers.ravel()]
    sightings = [
        Sighting(_marker(number), holder.corners_mm(number), corners)
        for number, quad in zip(read, quads, strict=True)
        if number in holder.centres_mm and (corners := _refined(light, quad.reshape(4, 2))) is not None
    ]
    on_board = [place for place, number in enumerate(read) if holder.board and number < holder.board.markers]
    if holder.board and on_board:
        sightings += _of_board(gray, holder.board, dictionary, [quads[place] for place in on_board], numbers[on_board])
    return sightings, set(read) - set(holder.centres_mm) - {read[place] for place in on_board}


def _of_board(gray: Any, board: Board, dictionary: Any, quads: Any, numbers: Any) -> Iterator[Sighting]:
    import cv2

    drawn = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_mm, board.marker_mm, dictionary)
    points, which, _, _ = cv2.aruco.CharucoDetector(drawn).detectBoard(gray, markerCorners=quads, markerIds=numbers)
    if which is None:
        return
    for number, point in zip(which.ravel().tolist(), points.reshape(-1, 1, 2), strict=True):
        yield Sighting(_corner(number), np.array([board.corner_mm(number)]), point.astype(np.float64))


def _refined(light: Any, quad: Any) -> Points | None:
    """Where the lines along the four edges of a black square meet, from the corners (4, 2) to about a pixel.

    None where there are no such edges: a marker can be read although a corner was taken for one that is not its own.

    An edge lies where black would have to end and white to begin so that the light across it is the same: a mean over
    the whole edge, which blur moves at corners only.
    """
    import cv2

    corners = np.asarray(quad, np.float64)
    for _ in range(_REFINEMENTS):
        sides = np.roll(corners, -1, axis=0) - corners
        lengths = np.linalg.norm(sides, axis=1)
        reach = max(1.0, float(lengths.min()) / 12.0)  # half a cell: the next cell may be white again
        outwards = np.stack((sides[:, 1], -sides[:, 0]), axis=1) / lengths[:, None]
        along = corners[:, None] + _ALONG[:, None] * sides[:, None]
        where = along[:, :, None] + (reach * _ACROSS)[:, None] * outwards[:, None, None]
        flat = where.reshape(4 * len(_ALONG), len(_ACROSS), 2).astype(np.float32)
        profiles = cv2.remap(light, flat[..., 0], flat[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        # The mean profiles of the two halves of an edge give two points of its line.
        halves = profiles.reshape(4, 2, len(_ALONG) // 2, len(_ACROSS)).mean(axis=2, dtype=np.float64)
        black, white = halves[..., :3].mean(axis=-1), halves[..., -3:].mean(axis=-1)
        if (white <= black).any():
            return None
        share = (halves.mean(axis=-1) - black) / (white - black)
        offset = np.clip(reach * (1.0 - 2.0 * share), -reach, reach)
        points = along.reshape(4, 2, -1, 2).mean(axis=2) + offset[..., None] * outwards[:, None]
        corners = _crossings(points)
    return corners if np.abs(offset).max() < _SETTLED_PX else None


def _crossings(points: Points) -> Points:
    """Corners (4, 2) of a square from two points (4, 2, 2) of each of its sides: side k runs from corner k to k + 1."""
    normals = np.stack((points[:, 1, 1] - points[:, 0, 1], points[:, 0, 0] - points[:, 1, 0]), axis=-1)
    offsets = (normals * points[:, 0]).sum(axis=-1)
    pairs = np.stack((np.roll(normals, 1, axis=0), normals), axis=1)
    return np.linalg.solve(pairs, np.stack((np.roll(offsets, 1), offsets), axis=1)[..., None])[..., 0]


def _grays(light: Any) -> Iterator[NDArray[np.uint8]]:
    """The picture in 8 bits, in ever more of which dark markers keep their contrast beside a bright sample."""
    for white_percent in _WHITE_PERCENT:
        yield _gray(light, white_percent)
    darkest = max(float(np.percentile(light, 50.0)) * _DARKEST, 1e-30)
    yield _gray(np.log(np.maximum(light, darkest)), 100.0)


def _gray(light: Any, white_percent: float) -> NDArray[np.uint8]:
    """8 bits, in which all that is brighter than so many pixels are is white."""
    black, white = np.percentile(light, (0.5, white_percent))
    return np.asarray(np.clip((light - black) * (255.0 / max(float(white - black), 1e-12)), 0.0, 255.0), np.uint8)


def _marker(number: int) -> str:
    return f"marker {number}"


def _corner(number: int) -> str:
    return f"board corner {number}"


def _borne(holder: Holder) -> list[str]:
    """All that can be found on a holder."""
    corners = (holder.board.columns - 1) * (holder.board.rows - 1) if holder.board else 0
    return [*map(_marker, holder.centres_mm), *map(_corner, range(corners))]
