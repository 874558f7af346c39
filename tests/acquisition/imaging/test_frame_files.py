"""Pictures of a run on disk: whole, numbered on, and known again."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from acquisition.imaging.frame_files import FrameFiles, load_frame
from drivers.camera.frame import Frame
from goniometer.errors import JournalError


def frame(seed, shape=(24, 31), number=5):
    counts = np.random.default_rng(seed).integers(0, 65536, shape, np.uint16)
    return Frame(counts, 16, 0.25, 6.0, 12.125, number)


def test_pictures_come_back_as_they_were(tmp_path):
    taken = [frame(1), replace(frame(2, number=None), averaged=7)]
    stored = FrameFiles(tmp_path).save(taken)
    assert [one.file for one in stored] == ["frames/000000.png", "frames/000001.png"]
    for before, kept in zip(taken, stored, strict=True):
        after = load_frame(tmp_path, kept)
        assert_array_equal(after.counts, before.counts)
        assert after.counts.dtype == np.uint16
        assert after.averaged == before.averaged
        assert (after.bits, after.exposure_s, after.gain_db, after.time_s, after.number) == (
            *(before.bits, before.exposure_s, before.gain_db, before.time_s),
            before.number,
        )


def test_a_run_that_goes_on_writes_over_no_picture(tmp_path):
    (first,) = FrameFiles(tmp_path).save([frame(1)])
    (second,) = FrameFiles(tmp_path).save([frame(2)])
    assert first.file != second.file
    assert_array_equal(load_frame(tmp_path, first).counts, frame(1).counts)


def test_a_run_without_a_camera_gets_no_folder(tmp_path):
    assert FrameFiles(tmp_path).save(()) == ()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("harm", "what"),
    [
        (lambda path: path.unlink(), "cannot be read"),
        (lambda path: path.write_bytes(path.read_bytes()[:200]), "damaged or exchanged"),
        (lambda path: path.write_bytes(b""), "cannot be read|damaged or exchanged"),
        (
            lambda path: FrameFiles(path.parents[1]).save([frame(3)]) and path.with_name("000001.png").rename(path),
            "exch",
        ),
    ],
    ids=["missing", "cut", "empty", "exchanged"],
)
def test_a_picture_that_is_not_the_stored_one_is_refused(tmp_path, harm, what):
    (stored,) = FrameFiles(tmp_path).save([frame(1)])
    harm(tmp_path / stored.file)
    with pytest.raises(JournalError, match=what):
        load_frame(tmp_path, stored)
