from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.protocols import Camera
from goniometer.errors import DeviceFaultError, LimitError, NotConnectedError, ReplyError, SaturatedError


@pytest.fixture
def read(until):
    def reading(camera, exposure_s):
        camera.start_reading(exposure_s)
        until(lambda: not camera.is_reading())
        return camera.frame()

    return reading


def test_satisfies_the_protocol(make_camera):
    assert isinstance(make_camera("none.avi"), Camera)


def test_file_is_played_picture_by_picture_each_once(make_camera, read, tmp_path, clock, videos):
    pictures = [videos.noise(40 + 10 * k, k) for k in range(6)]
    cam = make_camera(videos.write(tmp_path / "a.avi", pictures))
    assert cam.connect() == ()
    clock.time_s = 17.0
    first = read(cam, 0.1)
    second = read(cam, 0.32)
    assert cam.actual_exposure_s == pytest.approx(0.3)
    assert_array_equal(first.counts, pictures[0] * np.uint16(257))
    assert_allclose(second.counts / 257, np.mean(pictures[1:4], axis=0), atol=0.5 / 257 + 1e-12)
    assert (second.bits, second.exposure_s, second.time_s, second.number) == (16, 0.1, 17.0, 1)
    assert_array_equal(read(cam, 0.01).counts, pictures[4] * np.uint16(257))


def test_power_is_that_of_the_region(make_camera, read, tmp_path, videos):
    picture = videos.noise(50, 1)
    picture[4:16, 8:24] += 100
    cam = make_camera(videos.write(tmp_path / "a.avi", [picture] * 3), gain_db=6.0)
    cam.connect()
    read(cam, 0.3)
    mean = picture[4:16, 8:24].mean()
    assert cam.power_w() == pytest.approx(mean * 257 / 0.1 * 1e-12 / 10 ** (6 / 20))
    assert cam.read().mean_counts == pytest.approx(mean * 257)
    assert cam.read().variance_counts2 == pytest.approx(picture[4:16, 8:24].var() * 257**2)


def test_saturated_in_one_of_its_pictures(make_camera, read, tmp_path, videos):
    pictures = [videos.noise(50, seed) for seed in range(4)]
    pictures[1][5, 10] = 255
    path = videos.write(tmp_path / "a.avi", pictures)
    cam = make_camera(path)
    cam.connect()
    frame = read(cam, 0.4)
    assert frame.counts[5, 10] == frame.largest_counts
    with pytest.raises(SaturatedError, match="cam: the detector was saturated: 1 of the region's 192 pixels"):
        cam.power_w()
    tolerant = make_camera(path, most_saturated=0.01)
    tolerant.connect()
    read(tolerant, 0.4)
    assert tolerant.power_w() > 0


def test_end_of_the_file_is_told_at_the_reading_that_needs_more(make_camera, read, until, tmp_path, videos):
    cam = make_camera(videos.write(tmp_path / "short.avi", [videos.noise(50, seed) for seed in range(4)]))
    cam.connect()
    read(cam, 0.3)
    cam.start_reading(0.2)
    with pytest.raises(DeviceFaultError, match=r"cam: the video file .*short\.avi has ended, after 4 pictures"):
        until(lambda: not cam.is_reading())
    with pytest.raises(ReplyError, match="no finished reading"):
        cam.frame()


def test_warm_up_pictures_are_thrown_away(make_camera, read, tmp_path, videos):
    pictures = [videos.noise(50, seed) for seed in range(4)]
    cam = make_camera(videos.write(tmp_path / "a.avi", pictures), warm_up_frames=2)
    cam.connect()
    assert_array_equal(read(cam, 0.1).counts, pictures[2] * np.uint16(257))


@pytest.fixture
def coloured(videos):
    return np.dstack([videos.noise(30, 1), videos.noise(90, 2), videos.noise(150, 3)])


@pytest.mark.parametrize(("channel", "expected"), [("blue", 0), ("green", 1), ("red", 2)])
def test_channel_of_a_coloured_picture(make_camera, read, tmp_path, channel, expected, videos, coloured):
    cam = make_camera(videos.write(tmp_path / "a.avi", [coloured] * 2), channel=channel)
    cam.connect()
    assert_array_equal(read(cam, 0.1).counts, coloured[:, :, expected] * np.uint16(257))


def test_gray_of_a_coloured_picture(make_camera, read, tmp_path, videos, coloured):
    cam = make_camera(videos.write(tmp_path / "a.avi", [coloured] * 2), channel="gray")
    cam.connect()
    expected = coloured @ np.array([0.114, 0.587, 0.299])  # ITU-R BT.601
    assert_allclose(read(cam, 0.1).counts / 257, expected, atol=0.51)


def test_colours_that_nobody_has_chosen_from_are_refused(make_camera, until, tmp_path, videos, coloured):
    cam = make_camera(videos.write(tmp_path / "a.avi", [coloured] * 2))
    cam.connect()
    cam.start_reading(0.1)
    with pytest.raises(DeviceFaultError, match=r"in colours: red, green and blue differ.*channel: green"):
        until(lambda: not cam.is_reading())


def test_other_size_is_refused(make_camera, tmp_path, videos):
    path = videos.write(tmp_path / "a.avi", [videos.noise(50, 0, 80, 60)] * 2)
    with pytest.raises(DeviceFaultError, match="picture of 80 x 60 pixels came, where they should have 64 x 48"):
        make_camera(path).connect()


def test_other_rate_is_refused(make_camera, tmp_path, videos):
    path = videos.write(tmp_path / "a.avi", [videos.noise(50, 0)] * 2, frames_per_s=25.0)
    with pytest.raises(DeviceFaultError, match=r"pictures come every 0\.04 s, where the rig file has sample_s: 0\.1"):
        make_camera(path).connect()


def test_no_video(make_camera, tmp_path):
    path = tmp_path / "text.avi"
    path.write_text("no video")
    for each in (path, tmp_path / "none.avi"):
        with pytest.raises(NotConnectedError, match=r"cam: OpenCV cannot open .*\.avi as a video"):
            make_camera(str(each)).connect()


def test_cut_file_ends_early(make_camera, until, tmp_path, videos):
    path = tmp_path / "a.avi"
    videos.write(path, [videos.noise(50, seed) for seed in range(8)])
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    cam = make_camera(str(path))
    cam.connect()
    cam.start_reading(0.8)
    with pytest.raises(DeviceFaultError, match=r"has ended, after [1-7] pictures"):
        until(lambda: not cam.is_reading())


@pytest.mark.parametrize("exposure_s", [0.0, -1.0, 3601.0, float("nan")])
def test_impossible_exposure(make_camera, tmp_path, exposure_s, videos):
    cam = make_camera(videos.write(tmp_path / "a.avi", [videos.noise(50, 0)]))
    cam.connect()
    with pytest.raises(LimitError, match="is not between 0 and 3600 s"):
        cam.start_reading(exposure_s)


def test_not_connected(make_camera, tmp_path, videos):
    cam = make_camera(videos.write(tmp_path / "a.avi", [videos.noise(50, 0)]))
    with pytest.raises(NotConnectedError, match="not open"):
        cam.start_reading(0.1)
    cam.connect()
    cam.close()
    with pytest.raises(NotConnectedError, match="not open"):
        cam.start_reading(0.1)
    with pytest.raises(ReplyError, match="no finished reading"):
        cam.power_w()
