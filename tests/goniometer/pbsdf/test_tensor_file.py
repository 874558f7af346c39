"""Mitsuba's tensor files, byte by byte."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from goniometer.errors import JournalError
from goniometer.pbsdf.tensor_file import read_tensor_file, write_tensor_file


def test_a_file_is_what_the_format_says_to_the_last_byte(tmp_path):
    write_tensor_file(tmp_path / "a", {"ab": np.array([[1.0, -2.0]], np.float32), "w": np.array([450], np.uint16)})
    header = b"tensor_file\0" + bytes([1, 0]) + bytes([2, 0, 0, 0])
    ab = bytes([2, 0]) + b"ab" + bytes([2, 0]) + bytes([10]) + (72).to_bytes(8, "little")
    ab += (1).to_bytes(8, "little") + (2).to_bytes(8, "little")
    w = bytes([1, 0]) + b"w" + bytes([1, 0]) + bytes([3]) + (80).to_bytes(8, "little") + (1).to_bytes(8, "little")
    fields = header + ab + w
    data = bytes.fromhex("0000803f 000000c0") + (450).to_bytes(2, "little")
    assert (tmp_path / "a").read_bytes() == fields + bytes(72 - len(fields)) + data


@pytest.mark.parametrize("order", ["<", ">"])
def test_arrays_come_back_with_type_shape_and_values(tmp_path, order):
    draw = np.random.default_rng(1)
    arrays = {
        "words": np.frombuffer("σ = 0.18".encode(), np.uint8),
        "M": draw.normal(size=(2, 3, 4)).astype(f"{order}f4").transpose(2, 0, 1),
        "long": draw.normal(size=5).astype(f"{order}f8"),
        "whole": np.array([[7], [-8]], f"{order}i4"),
    }
    write_tensor_file(tmp_path / "a", arrays)
    found = read_tensor_file(tmp_path / "a")
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype.newbyteorder("<")
        assert_array_equal(found[name], array)


def test_what_is_no_tensor_file_is_refused(tmp_path):
    path = tmp_path / "a"
    with pytest.raises(JournalError, match="cannot be read"):
        read_tensor_file(path)
    path.write_bytes(b"something else entirely")
    with pytest.raises(JournalError, match=r"is not a tensor file of version 1\.0"):
        read_tensor_file(path)
    write_tensor_file(path, {"M": np.zeros((4, 4), np.float32)})
    whole = path.read_bytes()
    for length in range(14, len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(JournalError, match="damaged"):
            read_tensor_file(path)
