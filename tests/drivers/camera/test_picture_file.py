from __future__ import annotations

import random
import struct
import sys
import zlib

import cv2
import numpy as np
import pytest

from drivers.camera.picture_file import counts_of
from goniometer.errors import ConfigurationError, ReplyError

COUNTS = np.random.default_rng(3).integers(0, 4096, (9, 13)).astype(np.uint16)


def encoded(kind, counts=COUNTS, *parameters):
    return cv2.imencode(kind, counts, parameters)[1].tobytes()


def decoded(data, width=13, height=9, bits=12):
    return counts_of("camera", data, width=width, height=height, bits=bits)


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


PNG = encoded(".png")
KINDS = {
    "png": PNG,
    "tiff": encoded(".tiff", COUNTS, cv2.IMWRITE_TIFF_COMPRESSION, 1),
    "tiff lzw": encoded(".tiff", COUNTS, cv2.IMWRITE_TIFF_COMPRESSION, 5),
    "tiff deflate": encoded(".tiff", COUNTS, cv2.IMWRITE_TIFF_COMPRESSION, 8),
}


@pytest.mark.parametrize("kind", KINDS)
def test_counts_come_as_they_were(kind):
    counts = decoded(KINDS[kind])
    np.testing.assert_array_equal(counts, COUNTS)
    assert counts.dtype == np.uint16


def test_a_tiff_of_the_other_byte_order():
    tags = [
        (256, 3, 2),
        (257, 3, 1),
        (258, 3, 16),
        (259, 3, 1),
        (262, 3, 1),
        (273, 4, 8),
        (277, 3, 1),
        (278, 3, 1),
        (279, 4, 4),
    ]
    fields = b"".join(
        struct.pack(">HHIHH", tag, kind, 1, value, 0) if kind == 3 else struct.pack(">HHII", tag, kind, 1, value)
        for tag, kind, value in tags
    )
    data = (
        b"MM\0*"
        + struct.pack(">I", 12)
        + struct.pack(">HH", 513, 4000)
        + struct.pack(">H", len(tags))
        + fields
        + bytes(4)
    )
    np.testing.assert_array_equal(decoded(data, 2, 1), [[513, 4000]])


def test_8_bits_become_16():
    counts = decoded(encoded(".png", (COUNTS >> 4).astype(np.uint8)), bits=8)
    np.testing.assert_array_equal(counts, COUNTS >> 4)
    assert counts.dtype == np.uint16


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_cut_anywhere_is_refused(kind):
    data = KINDS[kind]
    for cut in range(len(data)):
        with pytest.raises(ReplyError, match="camera: the camera has sent a file that cannot be"):
            decoded(data[:cut])


def test_a_bit_turned_anywhere_in_a_png_is_refused():
    for at in range(len(PNG)):
        with pytest.raises(ReplyError, match="camera: the camera has sent"):
            decoded(PNG[:at] + bytes([PNG[at] ^ 16]) + PNG[at + 1 :])


def test_a_broken_tiff_is_a_picture_of_the_size_or_refused():
    generator, refused = random.Random(4), 0
    for kind in ("tiff", "tiff lzw", "tiff deflate") * 300:
        data = bytearray(KINDS[kind])
        for _ in range(generator.randint(1, 3)):
            data[generator.randrange(len(data))] = generator.randrange(256)
        try:
            assert decoded(bytes(data)).shape == COUNTS.shape
        except ReplyError:
            refused += 1
    assert refused > 300


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "neither PNG nor TIFF"),
        (encoded(".jpg", (COUNTS >> 4).astype(np.uint8)), "neither PNG nor TIFF"),
        (encoded(".png", COUNTS.T.copy()), "gray picture of 9 x 13 pixels of 16 bits in place of a gray picture of 13"),
        (encoded(".tiff", np.dstack([COUNTS] * 3)), "a coloured picture of 13 x 9 pixels"),
        (encoded(".tiff", (COUNTS >> 4).astype(np.uint8)), "pixels of 8 bits in place of"),
        (encoded(".png", COUNTS | np.uint16(4096)), r"more than 12 bits hold: .* width_px, height_px, bits"),
        (KINDS["tiff"][:-4] + b"\x08\0\0\0", "several pictures"),
        (PNG[:33] + chunk(b"acTL", bytes(8)) + PNG[33:], "several pictures"),
        (PNG[:8] + PNG[33:], "does not begin with the size"),
        (PNG[:8] + chunk(b"IHDR", b"\x7f\xff\xff\xff\x7f\xff\xff\xff\x10" + bytes(4)) + PNG[33:], "2147483647 x"),
        (PNG[:33] + chunk(b"IDAT", zlib.compress(b"few")) + chunk(b"IEND", b""), "cannot be decoded"),
    ],
)  # fmt: skip
def test_what_is_no_such_picture_is_refused(data, message):
    with pytest.raises(ReplyError, match=message):
        decoded(data)


def test_without_its_packages_a_person_is_told_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(ConfigurationError, match=r"cv2 is not installed. .* pip install 'goniometer\[camera\]'"):
        decoded(PNG)
