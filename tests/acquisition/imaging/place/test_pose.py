"""Where the plate stands, from pictures of its markers."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.imaging.place.arms import Arms
from acquisition.imaging.place.holder import Board, Holder
from acquisition.imaging.place.markers import Seen, Sighting, seen
from acquisition.imaging.place.optics import Optics
from acquisition.imaging.place.pose import Pose, pose
from goniometer.errors import ReductionError

DISTORTED = Optics(1900.0, (160.3, 118.6), (-0.3, 0.1, 1e-3, -5e-4, 0.0))
EXITS_DEG = [-40.0, 0.0, 15.0, 45.0, 60.0]


@pytest.fixture(scope="module")
def drawn(drawing):
    return drawing.plate()


def sighted(drawing, view, drawn, **how):
    return seen(view.picture(drawn, fine=5, **how), drawing.HOLDER, view.exit_deg)


def direct(found, view, drawing):
    """Largest distance between where a pose has points of the plate and where rays through them are."""
    columns, rows = np.meshgrid(np.linspace(20, 300, 15), np.linspace(10, 230, 23))
    plate = view.plate_mm(columns.ravel(), rows.ravel())
    there = np.abs(plate).max(axis=1) < 18.0
    missed = found.pixels(*plate.T, view.optics) - np.column_stack((columns.ravel(), rows.ravel()))
    return np.abs(missed[there]).max(axis=0)


@pytest.mark.parametrize("azimuth_deg", [0.0, -8.0])
@pytest.mark.parametrize("exit_deg", EXITS_DEG)
def test_the_pose_of_the_arms_comes_back_through_a_distorting_lens(drawing, drawn, exit_deg, azimuth_deg):
    view = drawing.View(exit_deg, azimuth_deg, optics=DISTORTED)
    found = pose(sighted(drawing, view, drawn), DISTORTED, Arms(60.0, exit_deg, azimuth_deg))
    assert found.used == 4
    assert found.notes == ()
    assert_allclose([found.exit_deg, found.sideways_deg], [exit_deg, 0.0], atol=0.3)
    assert_allclose(found.azimuth_deg, azimuth_deg, atol=0.05)
    assert_allclose(found.camera_mm, drawing.DISTANCE_MM * view.axes()[2], atol=1.5)
    assert (direct(found, view, drawing) < 0.1).all()  # a third of what maps may be off


@pytest.mark.parametrize("exit_deg", [65.0, 70.0])
def test_markers_are_read_at_grazing_exit(drawing, drawn, exit_deg):
    view = drawing.View(exit_deg)
    found = pose(sighted(drawing, view, drawn), view.optics, Arms(60.0, exit_deg))
    assert found.used == 4
    assert (direct(found, view, drawing) < (0.06, 0.15)).all()


@pytest.mark.parametrize(("exit_deg", "azimuth_deg"), [(60.0, 20.0), (45.0, -30.0)])
def test_markers_are_read_whose_cells_lean_because_the_sample_is_turned(drawing, exit_deg, azimuth_deg):
    drawn = drawing.plate(white=0.15, black=0.03, right=0.7, left=1.0)  # paper darker than metal
    view = drawing.View(exit_deg, azimuth_deg, optics=Optics(1300.0, (160.3, 118.6)))
    found = pose(sighted(drawing, view, drawn), view.optics, Arms(60.0, exit_deg, azimuth_deg))
    assert found.used == 4
    assert (direct(found, view, drawing) < 0.15).all()


def test_a_marker_is_read_whose_black_square_all_but_touches_the_pictures_edge(drawing, drawn):
    view = drawing.View(0.0, optics=Optics(1900.0, (121.3, 118.6)))
    corner = view.optics.centre_px[0] - 19.0 / drawing.DISTANCE_MM * view.optics.focal_px
    assert 0.5 < corner < 1.5
    assert len(sighted(drawing, view, drawn).sightings) == 4


def test_bad_pixels_and_a_glint_that_outshines_the_markers_do_not_hide_them(drawing, drawn):
    view = drawing.View(30.0)
    picture = view.picture(drawn, fine=5)
    rows, columns = np.indices(picture.shape)
    picture += 30.0 * np.exp(-((columns - 160) ** 2 + (rows - 118) ** 2) / 300.0)
    picture[np.random.default_rng(2).random(picture.shape) < 0.003] = np.nan
    found = pose(seen(picture, drawing.HOLDER, 30.0), view.optics, Arms(60.0, 30.0))
    assert found.used == 4
    assert (direct(found, view, drawing) < 0.1).all()


@pytest.mark.parametrize("hidden", [(0, 3), (0, 2)], ids=["one side", "diagonal"])
def test_two_of_four_markers_do(drawing, hidden):
    view = drawing.View(45.0)
    sight = sighted(drawing, view, drawing.plate(hidden=hidden))
    assert sight.missing == tuple(f"marker {number}" for number in hidden)
    found = pose(sight, view.optics, Arms(60.0, 45.0))
    assert found.used == 2
    assert (direct(found, view, drawing) < 0.2).all()


def test_one_marker_does_not(drawing):
    view = drawing.View(45.0)
    sight = sighted(drawing, view, drawing.plate(hidden=(0, 1, 2)))
    with pytest.raises(
        ReductionError, match=r"were found: marker 3; needed are 2.*not found: marker 0, marker 1, marker 2.*Uncover"
    ):
        pose(sight, view.optics, Arms(60.0, 45.0))


def test_a_marker_with_another_ones_number_is_left_out_and_named(drawing):
    view = drawing.View(30.0)
    sight = sighted(drawing, view, drawing.plate(read_as={1: 3}))
    assert [one.name for one in sight.sightings].count("marker 3") == 2
    found = pose(sight, view.optics, Arms(60.0, 30.0))
    assert found.used == 3
    missing, left_out = found.notes
    assert missing == "not found: marker 1"
    assert left_out.startswith("marker 3 left out: ")
    assert (direct(found, view, drawing) < 0.1).all()


def test_a_number_that_is_not_on_the_holder_is_told_when_markers_lack(drawing):
    view = drawing.View(0.0)
    sight = sighted(drawing, view, drawing.plate(hidden=(0, 1), read_as={2: 17}))
    assert sight.strangers == (17,)
    with pytest.raises(ReductionError, match="read, but not on the holder: 17"):
        pose(sight, view.optics, Arms(60.0, 0.0))


def moved(sight, name, corner, by_px):
    """The same, with one corner of a marker found elsewhere."""

    def wrong(one):
        pixels = one.pixels.copy()
        pixels[corner] += by_px
        return replace(one, pixels=pixels)

    return Seen(tuple(wrong(one) if one.name == name else one for one in sight.sightings), (), ())


@pytest.mark.parametrize("by_px", [(1.2, 0.0), (0.0, -1.5), (4.0, 3.0), (60.0, -10.0)])
@pytest.mark.parametrize("name", ["marker 0", "marker 2"])
def test_a_corner_that_is_off_is_noticed_and_its_marker_left_out(drawing, drawn, name, by_px):
    view = drawing.View(45.0)
    sight = moved(sighted(drawing, view, drawn), name, 1, by_px)
    found = pose(sight, view.optics, Arms(60.0, 45.0))
    assert [note.split(" left")[0] for note in found.notes] == [name]
    assert found.used == 3
    assert (direct(found, view, drawing) < 0.1).all()


def test_two_markers_that_contradict_each_other_are_refused(drawing):
    view = drawing.View(45.0)
    sight = sighted(drawing, view, drawing.plate(hidden=(0, 3)))
    with pytest.raises(ReductionError, match=r"agree with each other: .*contradicting: marker"):
        pose(moved(sight, "marker 1", slice(None), (5.0, 3.0)), view.optics, Arms(60.0, 45.0))


@pytest.mark.parametrize(
    ("arms", "told"),
    [
        (Arms(60.0, 41.0), r"exit angle 45\.\d\d° by the markers, 41\.00° by the arms"),
        (Arms(60.0, -45.0), r"exit angle 45\.\d\d° by the markers, -45\.00° by the arms"),
        (Arms(60.0, 45.0, -10.0), r"azimuth against the camera 10\.\d\d° by the markers, -10\.00° by the arms"),
        (Arms(60.0, 45.0, 10.0, 4.0), r"azimuth against the camera 10\.\d\d° by the markers, 6\.00° by the arms"),
    ],
)
def test_a_pose_that_contradicts_the_arms_is_refused_with_both(drawing, drawn, arms, told):
    view = drawing.View(45.0, 10.0)
    sight = sighted(drawing, view, drawn)
    pose(sight, view.optics, Arms(60.0, 45.0, 370.0))
    with pytest.raises(ReductionError, match=told):
        pose(sight, view.optics, arms)


def test_markers_darker_than_the_plate_around_their_margin_are_read(drawing):
    drawn = drawing.plate(1.0, 1.0, white=0.4, black=0.02, spots=False)
    bright = np.where(abs(drawn - 0.1) < 0.003, 1.0, drawn)
    view = drawing.View(60.0, optics=Optics(1600.0, (160.0, 120.0)))
    sight = sighted(drawing, view, bright, blur_px=0.8)
    assert len(sight.sightings) == 4
    assert direct(pose(sight, view.optics, Arms(60.0, 60.0)), view, drawing).max() < 0.3


def noisy(where, optics, noise_px, random):
    """Four markers of 6 mm as seen from a pose."""
    square = np.array([(-3, 3), (3, 3), (3, -3), (-3, -3)], np.float64)
    sightings = []
    for number, centre in enumerate([(-26, 15), (26, 15), (26, -15), (-26, -15)]):
        plate = square + centre
        pixels = where.pixels(*plate.T, optics) + random.normal(0.0, noise_px, (4, 2))
        sightings.append(Sighting(f"marker {number}", plate, pixels))
    return Seen(tuple(sightings), (), ())


def test_a_tilt_that_a_long_lens_cannot_tell_near_the_normal_does_not_contradict_the_arms():
    optics, arms, random = Optics(9000.0, (239.5, 179.5)), Arms(60.0, 0.5), np.random.default_rng(2)
    where = Pose(arms.rotation(), np.array([0.0, 0.0, 3000.0]))
    found = [pose(noisy(where, optics, 0.1, random), optics, arms) for _ in range(30)]
    assert max(abs(one.sideways_deg) for one in found) > 2.0, "else the markers tell it"
    leaning = Pose(Arms(60.0, 12.0).rotation(), where.translation_mm)
    with pytest.raises(ReductionError, match=r"exit angle 1\d\.\d\d° by the markers, 0\.50° by the arms"):
        pose(noisy(leaning, optics, 0.05, random), optics, arms)


@pytest.mark.parametrize("exit_deg", [0.0, 60.0])
def test_a_chessboard_with_markers_serves_as_well(exit_deg):
    board = Board(7, 5, 5.0, 3.6, -17.5, -12.5)
    drawn = cv2.aruco.CharucoBoard(
        (7, 5), 5.0, 3.6, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    ).generateImage((1400, 1000))
    arms = Arms(60.0, exit_deg, 5.0)
    true = Pose(arms.rotation(), np.array([0.0, 0.0, 300.0]))
    optics = Optics(5000.0, (400.0, 300.0))
    feet = np.array([(-17.5, 12.5), (17.5, 12.5), (17.5, -12.5), (-17.5, -12.5)])
    onto = true.pixels(*feet.T, optics).astype(np.float32)
    texture = np.array([(-0.5, -0.5), (1399.5, -0.5), (1399.5, 999.5), (-0.5, 999.5)], np.float32)
    homography = cv2.getPerspectiveTransform(texture, (onto + 0.5) * 3 - 0.5)
    fine = cv2.warpPerspective(drawn, homography, (2400, 1800), borderValue=255)
    picture = cv2.GaussianBlur(cv2.resize(fine, (800, 600), interpolation=cv2.INTER_AREA), (0, 0), 0.6).astype(float)
    found = pose(seen(picture, Holder("DICT_4X4_50", 0.0, {}, board), exit_deg), optics, arms)
    assert found.used >= 20
    assert np.abs(found.pixels(*feet.T, optics) - onto).max() < 0.25
    assert_allclose(found.exit_deg, exit_deg, atol=0.5)


def test_of_three_markers_the_one_with_a_wrong_number_is_found_out(drawing):
    view = drawing.View(30.0)
    for hidden, misread, number in ((0, 1, 0), (2, 0, 2), (3, 1, 3)):
        sight = sighted(drawing, view, drawing.plate(hidden=(hidden,), read_as={misread: number}))
        found = pose(sight, view.optics, Arms(60.0, 30.0))
        assert [note.split(" left")[0] for note in found.notes] == [f"not found: marker {misread}", f"marker {number}"]
        assert found.used == 2
        assert (direct(found, view, drawing) < 0.6).all()


def test_where_a_plane_looks_alike_in_two_poses_that_of_the_arms_is_taken(drawing):
    """Seen from afar there is no perspective, and a plate looks alike tilted one way and the other."""
    far = Optics(190_000.0, (160.0, 120.0))
    for exit_deg in (-8.0, 8.0):
        true = Pose(Arms(60.0, exit_deg).rotation(), np.array([0.0, 0.0, 30_000.0]))
        random = np.random.default_rng(0)
        sightings = []
        for number in drawing.MARKERS:
            plate = drawing.HOLDER.corners_mm(number)
            pixels = true.pixels(*plate.T, far) + 0.02 * random.standard_normal((4, 2))
            sightings.append(Sighting(f"marker {number}", plate, pixels))
        found = pose(Seen(tuple(sightings), (), ()), far, Arms(60.0, exit_deg))
        assert_allclose(found.exit_deg, exit_deg, atol=0.5)


def test_a_lens_distorts_as_opencv_says():
    strong = Optics(900.0, (150.0, 110.0), (-0.4, 0.3, 0.05, -0.03, 0.2))
    there = Pose(Arms(60.0, 25.0, 15.0).rotation(), np.array([3.0, -2.0, 90.0]))
    plate = np.random.default_rng(0).uniform(-20.0, 20.0, (30, 2))
    turn, distortion = cv2.Rodrigues(there.rotation)[0], np.array(strong.distortion)
    solid = np.column_stack((plate, np.zeros(30)))
    expected = cv2.projectPoints(solid, turn, there.translation_mm, strong.matrix, distortion)[0].reshape(-1, 2)
    assert_allclose(there.pixels(*plate.T, strong), expected, rtol=1e-9)


def test_behind_the_camera_nothing_is_seen():
    there = Pose(Arms(60.0, 80.0).rotation(), np.array([0.0, 0.0, 10.0]))
    assert np.isnan(there.pixels(0.0, -20.0, DISTORTED)).all()
