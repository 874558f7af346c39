r"""Mitsuba's tensor files: named arrays one after the other, little-endian, each at a place that is aligned.

Layout: ``tensor_file\0``, version 1.0 (2 bytes), number of fields (uint32); of each field its name's length (uint16),
name, number of dimensions (uint16), type (uint8), place of its first byte in the file (uint64), shape (uint64 each).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.whole_file import written_whole
from goniometer.errors import JournalError

_MAGIC = b"tensor_file\0\x01\x00"
_TYPES = {
    1: "<u1",
    2: "<i1",
    3: "<u2",
    4: "<i2",
    5: "<u4",
    6: "<i4",
    7: "<u8",
    8: "<i8",
    9: "<f2",
    10: "<f4",
    11: "<f8",
}
_NUMBERS = {np.dtype(name): number for number, name in _TYPES.items()}
_ALIGNMENT = 8

Fields = Mapping[str, NDArray[Any]]


def write_tensor_file(path: Path, fields: Fields) -> None:
    """Write arrays under their names; a file that is there is replaced as a whole.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    arrays = {name.encode(): np.asarray(array) for name, array in fields.items()}
    arrays = {name: np.ascontiguousarray(array, array.dtype.newbyteorder("<")) for name, array in arrays.items()}
    place = len(_MAGIC) + 4 + sum(2 + len(name) + 11 + 8 * array.ndim for name, array in arrays.items())
    header, body = _MAGIC + struct.pack("<I", len(arrays)), []
    for name, array in arrays.items():
        gap = -place % _ALIGNMENT
        header += struct.pack("<H", len(name)) + name
        header += struct.pack("<HBQ", array.ndim, _NUMBERS[array.dtype], place + gap)
        header += struct.pack(f"<{array.ndim}Q", *array.shape)
        body.append((bytes(gap), array))
        place += gap + array.nbytes
    with written_whole(path) as part, part.open("wb") as file:
        file.write(header)
        for gap_bytes, array in body:
            file.write(gap_bytes)
            file.write(array.data)


def read_tensor_file(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a tensor file by name.

    Raises
    ------
    JournalError
        If it cannot be read, or is none.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise JournalError(f"The tensor file {path} cannot be read: {error}.") from error
    if not content.startswith(_MAGIC):
        raise JournalError(f"{path} is not a tensor file of version 1.0.")
    fields: dict[str, NDArray[Any]] = {}
    try:
        at = len(_MAGIC)
        (count,) = struct.unpack_from("<I", content, at)
        at += 4
        for _ in range(count):
            (length,) = struct.unpack_from("<H", content, at)
            name = content[at + 2 : at + 2 + length].decode()
            at += 2 + length
            dimensions, kind, place = struct.unpack_from("<HBQ", content, at)
            shape = struct.unpack_from(f"<{dimensions}Q", content, at + 11)
            at += 11 + 8 * dimensions
            fields[name] = np.frombuffer(content, _TYPES[kind], math.prod(shape), place).reshape(shape)
    except (struct.error, ValueError, KeyError) as error:
        raise JournalError(f"{path} is a damaged tensor file: {error}.") from error
    return fields
