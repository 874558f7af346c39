"""What a rig file may say of the sample holder's markers."""

import cv2
import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError

from acquisition.imaging.place.holder import _IDS, HolderEntry

GOOD = {"marker_mm": 6.0, "markers": {0: [-16, 11], 1: [16, 11.5]}}
BOARD = {"columns": 5, "rows": 4, "square_mm": 6.0, "marker_mm": 4.0, "corner_mm": [-15.0, -12.0]}


def test_corners_go_clockwise_from_the_upper_left_one_seen_from_above():
    holder = HolderEntry(**GOOD).holder()
    assert_allclose(holder.corners_mm(1), [(13, 14.5), (19, 14.5), (19, 8.5), (13, 8.5)])


def test_corners_of_a_board_are_counted_from_its_upper_left_one():
    board = HolderEntry(board=BOARD).holder().board
    assert board.markers == 10
    assert_allclose([board.corner_mm(0), board.corner_mm(3), board.corner_mm(4)], [(-9, 6), (9, 6), (-9, 0)])


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ({}, "at least 2 are needed"),
        ({"marker_mm": 6.0, "markers": {3: [0, 0]}}, "1 given; at least 2"),
        ({"markers": {3: [0, 0], 4: [20, 0]}}, "marker_mm: is missing"),
        (GOOD | {"markers": {0: [0, 0], 50: [20, 0]}}, "DICT_4X4_50 has the markers 0 to 49"),
        (GOOD | {"markers": {0: [0, 0], 7: [5.9, -5.9]}}, "markers.7: overlaps marker 0"),
        (GOOD | {"dictionary": "4x4"}, "4x4 is no set of markers; there are DICT_4X4_50"),
        ({"board": BOARD | {"marker_mm": 6.0}}, "6 does not fit into squares of 6 mm"),
        (GOOD | {"board": BOARD}, "markers.0: is also on the board, which bears 0 to 9"),
        (GOOD | {"markers": {20: [-17.9, 0]}, "board": BOARD}, "markers.20: lies on the board"),
        ({"board": BOARD | {"columns": 12, "rows": 10}}, "bears 60 markers, and DICT_4X4_50 has 50"),
    ],
)
def test_what_cannot_be_found_or_fitted_is_refused(entry, told):
    with pytest.raises(ValidationError) as caught:
        HolderEntry(**entry)
    assert told in str(caught.value)


def test_squares_that_touch_do_not_overlap():
    HolderEntry(**(GOOD | {"markers": {0: [0, 0], 7: [6.0, 0]}}))


def test_every_set_that_is_offered_is_known_to_opencv_and_as_large_as_said():
    for name, count in _IDS.items():
        assert len(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)).bytesList) == count
