"""What goes wrong with a camera in the middle of a scan, and with its pictures afterwards: an error or a flag, never a
wrong map or reading. The sensor has no noise, so that whatever was not disturbed is the same to the last bit."""

import io
import shutil
import sys
from contextlib import redirect_stderr, redirect_stdout

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from goniometer.cli import main

SILENT = {"dark_counts": 200, "dark_counts_per_s": 50}
BLURRED = [{"effect": "blur", "sigma_px": 0.7}]
FIT = {
    "lobes": ["specular", "diffuse"],
    "free": {"sigma": [0.05, 0.6]},
    "fixed": {"n": 2.95, "k": 2.932},
    "search": "sobol",
}
DURING_S = 10.9
"""On the bench's clock: between two readings of the second of three directions."""
LATE_S = 16.6
"""Likewise of the third one: before it there is enough for a fit."""
WHOLE, HURT = (0, 2), 1
WIDTH, MM_A_PIXEL = 200, 500 / 2150
SAID = {
    "frame_wrong_size": "a gray picture of 100 x 75 pixels of 16 bits in place of a gray picture of 200 x 150 pixels",
    "frame_corrupt": "a file that cannot be read",
    "frame_cut": "an answer that is no HTTP or not complete",
    "frame_stale": "once more: it shows an earlier moment",
    "frame_time_shifted": "the exposure began",
}


class Ended:
    """How the command ended, what it said, and what it left in the run's folder."""

    def __init__(self, exit_code, said, stored):
        self.exit_code, self.said, self.stored = exit_code, said, stored
        self.maps = stored.maps() if (stored.folder / "scan.nxs").exists() else None
        self.powers_w = {(one.point, one.kind, one.slot): one.power_w for one in stored.readings}


def command(*words):
    """Exit code and output; whatever is not an error of the project comes through, as it would with a traceback."""
    said = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said), redirect_stderr(said):
        patch.setattr(sys, "argv", ["goniometer", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
    return ended.value.code or 0, said.getvalue()


@pytest.fixture(scope="module")
def scan(tmp_path_factory, recipe_in, stored):
    """Runs the recipe with faults, through the command."""

    def scanned(*faults, imaging=None, **changes):
        folder = tmp_path_factory.mktemp("scan")
        struck = [{"device": "camera", "at_s": DURING_S} | fault for fault in faults]
        given = {"sensor": SILENT, "lens": BLURRED, "fit": FIT, "scene": {"faults": struck}} | changes
        recipe = recipe_in(folder, imaging={"registration": None} | (imaging or {}), **given)
        code, said = command("run", recipe, "--speed", "max", "--out", folder / "runs")
        (made,) = (folder / "runs").iterdir()
        return Ended(code, said, stored(made))

    return scanned


@pytest.fixture(scope="module")
def plain(scan):
    """What comes of the recipe when nothing goes wrong."""
    found = scan()
    assert (found.exit_code, len(found.powers_w)) == (0, 15)
    assert found.maps["notes"] == ["", "", ""]
    assert np.isfinite(found.maps["S0"]).all()
    return found


@pytest.fixture
def refitted(stored):
    """What `goniometer fit` makes of a run's folder."""

    def fitted(found):
        code, said = command("fit", found.stored.folder)
        assert code == 0, said
        return Ended(code, said, stored(found.stored.folder))

    return fitted


def require_same_maps(found, plain, directions):
    """Errors hang a little on the number of dark pictures, which is smaller in a scan that was cut off."""
    for row in directions:
        for name in ("S0", "S1", "S2"):
            assert_array_equal(found.maps[name][row], plain.maps[name][row], err_msg=f"{name} in direction {row}")
        assert_allclose(found.maps["S1_errors"][row], plain.maps["S1_errors"][row], rtol=5e-3)


def require_error(found, *said):
    assert found.exit_code == 1
    assert "Traceback" not in found.said
    for words in (*said, "camera: ", "Not done: ", "What to do: "):
        assert words in found.said


def require_what_was_read(found, plain, refitted):
    """A scan that was cut off in its third direction has the others' readings, and the command makes maps of them."""
    assert 10 <= len(found.powers_w) < 15
    assert all(plain.powers_w[name] == power_w for name, power_w in found.powers_w.items())
    again = refitted(found)
    assert "The scan was cut off before point 2 was finished" in again.said
    assert again.maps["notes"] == ["", ""]
    require_same_maps(again, plain, (0, 1))


@pytest.mark.parametrize("fault", [*SAID, "frame_dropped"])
def test_one_bad_picture_is_taken_again(scan, plain, fault):
    found = scan({"fault": fault})
    assert found.exit_code == 0
    assert found.powers_w == plain.powers_w
    assert found.maps["notes"] == ["", "", ""]
    require_same_maps(found, plain, (0, 1, 2))


@pytest.mark.parametrize("fault", SAID)
def test_pictures_that_stay_bad_end_the_scan_and_what_was_read_stays(scan, plain, refitted, fault):
    found = scan({"fault": fault, "frames": 20, "at_s": LATE_S})
    require_error(found, SAID[fault], "was thrown away")
    require_what_was_read(found, plain, refitted)


def test_a_saturated_region_ends_the_scan_and_what_was_read_stays(scan, plain, refitted):
    found = scan({"fault": "frame_saturated", "at_s": LATE_S})
    require_error(found, "the detector was saturated", "100 of the region's 100 pixels")
    require_what_was_read(found, plain, refitted)


def test_a_saturated_region_is_waited_for_where_the_recipe_says_so(scan, plain):
    found = scan({"fault": "frame_saturated", "frames": 3}, suspend={"saturated": True, "every_s": 1.0})
    assert found.exit_code == 0
    assert "goes on after" in found.said
    assert found.powers_w == plain.powers_w
    require_same_maps(found, plain, (0, 1, 2))


def test_saturated_pixels_beside_the_region_are_flagged(scan, plain, refitted):
    found = scan({"fault": "frame_saturated", "share": 0.3})
    assert found.exit_code == 0
    assert found.powers_w == plain.powers_w
    assert "30.0% of the pixels are saturated, and unknown" in found.maps["notes"][HURT]
    require_flagged_left_of(found, plain, HURT, 0.3)
    require_same_maps(found, plain, WHOLE)
    assert_array_equal(refitted(found).maps["S0"], found.maps["S0"])


def test_a_region_of_which_some_pixels_may_be_saturated_is_read_from_the_others(scan, plain):
    """Light falls on five of its ten columns; the others show the same to a part of the gradient across it."""
    found = scan({"fault": "frame_saturated", "share": 0.5}, camera={"most_saturated": 0.5})
    assert found.exit_code == 0
    for name, power_w in found.powers_w.items():
        assert power_w == pytest.approx(plain.powers_w[name], rel=2e-3), name
    assert "50.0% of the pixels are saturated, and unknown" in found.maps["notes"][HURT]


def test_saturated_pixels_in_a_dark_picture_are_flagged_everywhere(scan, plain):
    """From the two warm-up pictures to the first direction's dark one; the region is beside them."""
    found = scan({"fault": "frame_saturated", "share": 0.3, "frames": 7, "at_s": 0.0})
    assert found.exit_code == 0
    assert found.powers_w == plain.powers_w
    assert "are saturated, and unknown" not in found.maps["notes"][2]
    for row in range(3):
        assert "30.0% of the pixels are saturated in a dark picture" in found.maps["notes"][row]
        require_flagged_left_of(found, plain, row, 0.3)


def require_flagged_left_of(found, plain, row, share):
    """Nothing is said of what the saturated columns show; the pose rests on the other two markers."""
    x = found.maps["x"]
    edge_mm = (share * WIDTH - (WIDTH - 1) / 2) * MM_A_PIXEL
    s0 = found.maps["S0"][row]
    assert np.isnan(s0[:, x < edge_mm - 1]).all()
    assert np.isfinite(s0[:, x > edge_mm + 1]).all()
    assert "not found: marker 0, marker 3" in found.maps["notes"][row]
    require_alike(found, plain, row, np.isfinite(s0))


def require_alike(found, plain, row, where):
    """Another pose moves edges by a part of a pixel, and what is even not at all."""
    x, y = np.meshgrid(found.maps["x"], found.maps["y"])
    even = where & (np.abs(x - 2) > 1) & (np.abs(np.hypot(x - 9, y) - 3) > 1) & (np.abs(y) < 4)
    assert even.sum() > 500
    for name in ("S0", "S1"):
        assert_allclose(found.maps[name][row][even], plain.maps[name][row][even], rtol=0.02, atol=1e-3)


def test_a_picture_behind_a_stuck_shutter_makes_no_map_and_is_told(scan, plain, refitted):
    """The reading is true, of the dark; the maps and the fit would be wrong."""
    found = scan({"fault": "frame_dark"})
    assert found.exit_code == 0
    (dark,) = [name for name, power_w in found.powers_w.items() if power_w != plain.powers_w[name]]
    assert (dark[0], dark[1]) == (HURT, "signal")
    assert "point 1 are dark in a part where the others say that there is light" in found.said
    assert "maps of 2 of 3 directions" in found.said
    assert "dark where the others say that there is light" in found.maps["notes"][HURT]
    assert np.isnan(found.maps["S0"][HURT]).all()
    require_same_maps(found, plain, WHOLE)
    assert "are dark in a part" in refitted(found).said


def test_of_two_exposures_one_that_is_dark_contradicts_the_other(scan):
    found = scan({"fault": "frame_dark"}, imaging={"exposures": [1, 0.1]})
    assert found.exit_code == 0
    notes = found.maps["notes"]
    assert "another brightness in one exposure than in another" in notes[HURT] or "dark where" in notes[HURT]
    assert [notes[row] for row in WHOLE] == ["", ""]


@pytest.mark.parametrize(("hidden", "said"), [([0], "marker 0"), ([0, 2], "marker 0, marker 2")])
def test_markers_that_are_hidden_are_told_and_the_others_do(scan, plain, hidden, said):
    found = scan({"fault": "markers_hidden", "markers": hidden, "at_s": 8.5, "for_s": 5.5})
    assert found.exit_code == 0
    assert found.powers_w == plain.powers_w
    assert found.maps["notes"][HURT].startswith(f"not found: {said}")
    require_alike(found, plain, HURT, np.ones(found.maps["S0"][HURT].shape, bool))
    require_same_maps(found, plain, WHOLE)


def test_without_enough_markers_a_direction_has_no_map(scan, plain, refitted):
    found = scan({"fault": "markers_hidden", "markers": [0, 1, 2], "at_s": 8.5, "for_s": 5.5})
    assert found.exit_code == 0
    assert found.powers_w == plain.powers_w
    assert "maps of 2 of 3 directions" in found.said
    assert "Too few of the holder's markers were found: marker 3" in found.maps["notes"][HURT]
    assert np.isnan(found.maps["S0"][HURT]).all()
    require_same_maps(found, plain, WHOLE)
    require_same_maps(refitted(found), plain, WHOLE)


def test_without_any_marker_there_are_readings_and_no_maps(scan, plain):
    found = scan({"fault": "markers_hidden", "markers": [0, 1, 2, 3], "at_s": 0.5})
    assert found.exit_code == 0
    assert found.powers_w == plain.powers_w
    assert "maps of 0 of 3 directions" in found.said
    assert "S0" not in found.maps
    assert all("Too few of the holder's markers were found: none" in note for note in found.maps["notes"])


@pytest.mark.parametrize(
    ("shows", "said"),
    [(2, "marker 2 left out"), (9, "not found: marker 1; read, but not on the holder: 9")],
)
def test_a_marker_with_another_one_s_number_is_left_out(scan, plain, shows, said):
    found = scan({"fault": "marker_misprinted", "marker": 1, "shows": shows, "at_s": 8.5, "for_s": 5.5})
    assert found.exit_code == 0
    assert said in found.maps["notes"][HURT]
    require_alike(found, plain, HURT, np.ones(found.maps["S0"][HURT].shape, bool))
    require_same_maps(found, plain, WHOLE)


@pytest.mark.parametrize("at_s", [9.5, 9.9, 10.3, 10.6, 10.9])
def test_a_cable_that_is_pulled_and_plugged_in_again_costs_time_only(scan, plain, at_s):
    """In and between exposures."""
    found = scan({"fault": "cable_pulled", "for_s": 3.0, "at_s": at_s})
    assert found.exit_code == 0, found.said
    assert "is gone" in found.said
    assert any(key.startswith("link lost") for key in found.stored.about)
    assert found.powers_w == plain.powers_w
    require_same_maps(found, plain, (0, 1, 2))


def test_a_cable_that_stays_out_ends_the_scan(scan, plain, refitted):
    found = scan({"fault": "cable_pulled", "for_s": 1e6, "at_s": LATE_S})
    require_error(found, "the link on port", "is gone", "It was tried for 30 s to connect again")
    require_what_was_read(found, plain, refitted)


@pytest.fixture
def copied(plain, tmp_path, stored):
    """A finished run, to be damaged."""
    folder = tmp_path / "copied"
    shutil.copytree(plain.stored.folder, folder)
    return stored(folder)


def frame_of(stored, point, kind, number):
    """The file of a reading's picture."""
    of_kind = [
        frames
        for reading, frames in zip(stored.readings, stored.frames, strict=True)
        if (reading.point, reading.kind) == (point, kind)
    ]
    return stored.folder / of_kind[number][0].file


def deleted(path, other):
    path.unlink()


def cut(path, other):
    path.write_bytes(path.read_bytes()[:-500])


def exchanged(path, other):
    shutil.copyfile(other, path)


def retouched(path, other):
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    picture[60:80, 90:110] //= 2
    cv2.imwrite(str(path), picture)


@pytest.mark.parametrize("damaged", [deleted, cut, exchanged, retouched])
def test_a_picture_that_is_damaged_afterwards_costs_its_direction_only(copied, plain, damaged, stored):
    path = frame_of(copied, HURT, "signal", 2)
    damaged(path, frame_of(copied, HURT, "signal", 1))
    code, said = command("fit", copied.folder)
    assert code == 0, said
    found = Ended(code, said, stored(copied.folder))
    assert path.name in found.maps["notes"][HURT]
    assert np.isnan(found.maps["S0"][HURT]).all()
    assert found.powers_w == plain.powers_w
    require_same_maps(found, plain, WHOLE)
    assert (copied.folder / "fit.json").read_text() == (plain.stored.folder / "fit.json").read_text()


def test_a_dark_picture_that_is_damaged_is_made_up_for_by_the_others(copied, plain, stored):
    frame_of(copied, 0, "dark", 0).unlink()
    code, said = command("fit", copied.folder)
    assert code == 0, said
    found = Ended(code, said, stored(copied.folder))
    for row in range(3):
        assert_array_equal(found.maps["S0"][row], plain.maps["S0"][row])


def test_without_any_dark_picture_there_are_no_maps(copied, stored):
    for point in range(3):
        frame_of(copied, point, "dark", 0).unlink()
    code, said = command("fit", copied.folder)
    found = Ended(code, said, stored(copied.folder))
    assert code == 0, said
    assert "no maps: " in said
    assert "All dark pictures of 0.2 s are damaged" in said
    assert found.maps == {}


def test_without_dark_readings_maps_say_what_is_in_them(scan):
    found = scan(dark=False)
    assert found.exit_code == 0
    for note in found.maps["notes"]:
        assert "there are no dark pictures: what a pixel counts in the dark beyond black_counts is light here" in note
    known = scan().maps["S0"]
    apart = np.nanmedian(found.maps["S0"] / known, axis=(1, 2)) - 1.0
    assert (abs(apart) < 0.02).all(), "the black level is taken out as the rig states it, and dark current is little"
