"""Pictures that a scene names: files of gray values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import ConfigurationError


def gray_picture(path: Path) -> NDArray[np.unsignedinteger]:
    """The gray values of a file of 8 or 16 bits, (rows, columns).

    Raises
    ------
    ConfigurationError
        If there is no such file, or it is no picture of one gray channel of whole numbers.
    """
    import cv2

    if not path.is_file():
        raise ConfigurationError(
            [f"{path}: there is no such picture, and the plate needs it; give the path from the scene file's folder"]
        )
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise ConfigurationError([f"{path}: cannot be read as a picture; give a gray PNG or TIFF file"])
    if picture.ndim != 2 or picture.dtype not in (np.uint8, np.uint16):
        channels = 1 if picture.ndim == 2 else picture.shape[2]
        raise ConfigurationError(
            [
                f"{path}: has {channels} channel{'s' * (channels > 1)} of {picture.dtype}; one of 8 or 16 bits "
                "is needed: save it as grayscale"
            ]
        )
    return np.asarray(picture, picture.dtype)
