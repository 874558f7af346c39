"""From a camera's PNG or TIFF file to counts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.camera.installed import camera_package
from drivers.camera.picture_head import PictureHead, read_head
from drivers.camera.quiet_opencv import quiet_opencv
from goniometer.errors import ReplyError


def counts_of(name: str, data: bytes, *, width: int, height: int, bits: int) -> NDArray[np.uint16]:
    """Decode one gray picture.

    Parameters
    ----------
    name : str
        The camera's name in the rig file, for messages.
    data : bytes
        The file: 8 bits a pixel for `bits` of 8, else 16 bits with the counts right-aligned.
    width, height, bits : int
        What the picture is to have.

    Returns
    -------
    ndarray
        (height, width) of uint16.

    Raises
    ------
    ReplyError
        When the file is broken, or is not such a picture.
    """
    try:
        head = read_head(data)
    except ValueError as error:
        raise _unusable(name, f"a file that cannot be read: {error}") from None
    wanted = PictureHead(width, height, 8 if bits == 8 else 16, is_gray=True)
    if head != wanted:
        raise _unusable(name, f"{_words(head)} in place of {_words(wanted)}")
    counts = _decoded(data)
    if counts is None or counts.shape != (height, width) or counts.dtype.kind != "u":
        raise _unusable(name, "a file that cannot be decoded: what is in it is broken")
    largest = int(counts.max())
    if largest >> bits:
        raise _unusable(
            name, f"{largest} counts, more than {bits} bits hold: they are not right-aligned, or of more bits"
        )
    return counts.astype(np.uint16, copy=False)


def _decoded(data: bytes) -> NDArray[np.uint16] | None:
    cv2 = camera_package("cv2")
    quiet_opencv()
    try:
        counts: NDArray[np.uint16] | None = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    return counts


def _words(head: PictureHead) -> str:
    return (
        f"a {'gray' if head.is_gray else 'coloured'} picture of {head.width} x {head.height} pixels of {head.bits} bits"
    )


def _unusable(name: str, what: str) -> ReplyError:
    return ReplyError(
        name,
        f"the camera has sent {what}",
        not_done="the picture was thrown away",
        to_do="compare width_px, height_px, bits and still in the rig file with what the camera sends; when files come "
        "broken, look at the network between",
    )
