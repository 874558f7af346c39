"""What a PNG or TIFF file says of its picture, read before it is decoded.

A decoder makes of a file whatever is in it, at any size; a camera's file is to be one gray picture of a known size.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

_PNG = b"\x89PNG\r\n\x1a\n"
_TIFF_ORDERS = {b"II*\x00": "<", b"MM\x00*": ">"}
_TIFF_SIZES = {3: "H", 4: "I"}
_WIDTH, _HEIGHT, _BITS, _PHOTOMETRIC, _SAMPLES = 256, 257, 258, 262, 277
_BLACK_IS_ZERO = 1
_GRAY = 0


@dataclass(frozen=True)
class PictureHead:
    """Size and depth of a picture, and whether it is gray, brighter pixels with higher counts."""

    width: int
    height: int
    bits: int
    is_gray: bool


def read_head(data: bytes) -> PictureHead:
    """Read what a file says of its picture; raises ValueError, which says what is wrong with the file."""
    if data.startswith(_PNG):
        return _png(data)
    if data[:4] in _TIFF_ORDERS:
        return _tiff(data)
    raise ValueError(f"it is neither PNG nor TIFF (beginning {data[:8]!r})")


def _png(data: bytes) -> PictureHead:
    """All chunks are looked through: each has a checksum, and the last one says that nothing is missing."""
    head, at, kind = None, len(_PNG), b""
    while kind != b"IEND":
        if at + 12 > len(data):
            raise ValueError("it is not complete")
        length, kind = struct.unpack_from(">I4s", data, at)
        end = at + 8 + length
        if end + 4 > len(data):
            raise ValueError("it is not complete")
        if zlib.crc32(memoryview(data)[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            raise ValueError(f"a checksum does not fit ({kind.decode('latin-1')})")
        if head is None:
            if (kind, length) != (b"IHDR", 13):
                raise ValueError("it does not begin with the size of a picture")
            width, height, bits, colour = struct.unpack_from(">IIBB", data, at + 8)
            head = PictureHead(width, height, bits, colour == _GRAY)
        if kind == b"acTL":
            raise ValueError("it holds several pictures")
        at = end + 4
    assert head is not None, "the first chunk is the head"
    return head


def _tiff(data: bytes) -> PictureHead:
    """The only directory; there are no checksums."""
    order = _TIFF_ORDERS[data[:4]]
    try:
        (at,) = struct.unpack_from(f"{order}I", data, 4)
        (entries,) = struct.unpack_from(f"{order}H", data, at)
        tags: dict[int, int] = {}
        for entry in range(entries):
            place = at + 2 + 12 * entry
            tag, kind, count = struct.unpack_from(f"{order}HHI", data, place)
            if kind in _TIFF_SIZES and count == 1:
                (tags[tag],) = struct.unpack_from(f"{order}{_TIFF_SIZES[kind]}", data, place + 8)
        (another,) = struct.unpack_from(f"{order}I", data, at + 2 + 12 * entries)
    except struct.error:
        raise ValueError("it is not complete") from None
    if another:
        raise ValueError("it holds several pictures")
    if not {_WIDTH, _HEIGHT} <= tags.keys():
        raise ValueError("it does not say the size of its picture")
    is_gray = tags.get(_SAMPLES, 1) == 1 and tags.get(_PHOTOMETRIC) == _BLACK_IS_ZERO
    return PictureHead(tags[_WIDTH], tags[_HEIGHT], tags.get(_BITS, 1 if is_gray else 8), is_gray)
