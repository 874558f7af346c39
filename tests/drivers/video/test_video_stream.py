from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drivers.camera.capture import Capture, without_password
from drivers.camera.frame_reader import FrameReader
from goniometer.errors import DeviceFaultError, NotConnectedError, ReplyTimeoutError

PERIOD_S = 0.1


@pytest.fixture
def watch(stream, clock, until, videos):
    """Let the camera show pictures, each at its time, and wait until each has come."""

    def show(camera, arrivals_s, pictures):
        for arrived_s, picture in zip(arrivals_s, pictures, strict=True):
            clock.time_s = arrived_s
            before = camera.frames
            stream.show(picture if isinstance(picture, bytes) else videos.jpeg(picture))
            until(lambda before=before: camera.frames > before or not camera_is_well(camera))

    return show


def camera_is_well(camera):
    try:
        camera.is_reading()
    except (DeviceFaultError, NotConnectedError):
        return False
    return True


@pytest.fixture
def connected(make_camera, stream, clock, until):
    """A camera whose first pictures, which FFmpeg has looked at, have all come: the next one is due at 10.0 s."""

    def connect(**parameters):
        clock.time_s = 10.0 - PERIOD_S
        camera = make_camera(stream.url, **parameters)
        camera.connect()
        until(lambda: camera.frames == len(stream.opening))
        return camera

    return connect


def after(start_s, count):
    return start_s + PERIOD_S * np.arange(1, count + 1)


def test_only_pictures_begun_after_the_reading_are_in_it(connected, watch, clock, videos):
    camera = connected(latency_s=0.02)
    pictures = [videos.noise(40 + 20 * k, k) for k in range(6)]
    watch(camera, [10.00, 10.10], pictures[:2])
    camera.start_reading(0.2)
    watch(camera, [10.20, 10.30, 10.40, 10.50], pictures[2:])  # begun at 10.08, 10.18, 10.28, 10.38
    assert not camera.is_reading()
    seen = [videos.decoded(videos.jpeg(picture)) for picture in pictures]
    assert_allclose(camera.frame().counts / 257, np.mean(seen[3:5], axis=0), atol=0.5 / 257 + 1e-12)
    assert camera.frame().time_s == pytest.approx(10.18)


def test_reading_goes_on_until_its_last_picture(connected, watch, clock, videos):
    camera = connected()
    watch(camera, [10.0], [videos.noise(50, 0)])
    camera.start_reading(0.3)
    watch(camera, after(10.0, 2), [videos.noise(50, k) for k in (1, 2)])
    assert camera.is_exposing()
    assert camera.is_reading()
    watch(camera, [10.3], [videos.noise(50, 3)])
    assert not camera.is_exposing()
    assert not camera.is_reading()


def test_others_stand_in_for_dropped_pictures(connected, watch, clock, videos):
    camera = connected()
    watch(camera, [10.0], [videos.noise(50, 0)])
    camera.start_reading(0.6)
    pictures = [videos.noise(50 + 9 * k, k) for k in range(6)]
    watch(camera, [10.1, *after(10.3, 4)], pictures[:5])
    assert camera.dropped_frames == 2
    assert camera.is_reading()
    watch(camera, after(10.7, 1), pictures[5:])
    assert not camera.is_reading()
    assert camera.frame().averaged == 6
    seen = [videos.decoded(videos.jpeg(picture)) for picture in pictures]
    assert_allclose(camera.frame().counts / 257, np.mean(seen, axis=0), atol=0.5 / 257 + 1e-12)


def test_pictures_that_were_only_late_are_neither_lost_nor_taken_for_new_ones(connected, watch, clock, videos):
    """The computer was busy from 10.1 s on: what waited for it meanwhile was begun before the reading."""
    camera = connected()
    watch(camera, [10.0, 10.1], [videos.noise(40, k) for k in range(2)])
    clock.time_s = 10.65
    camera.start_reading(0.2)
    watch(camera, [10.65] * 5, [videos.noise(40, k) for k in range(5)])  # due at 10.2 to 10.6
    assert camera.is_reading()
    watch(camera, after(10.6, 3), [videos.noise(mean, 1) for mean in (40, 90, 90)])
    assert not camera.is_reading()
    assert camera.dropped_frames == 0
    assert camera.frame().time_s == pytest.approx(10.7)
    assert camera.frame().counts.mean() / 257 == pytest.approx(90, abs=1)


def test_what_a_poll_has_seen_of_a_reading_stays_as_it_was(stream, clock, until, videos):
    """Pictures come in a thread: were they to change it, a gap might come between looking for one and for the end."""
    capture = Capture(stream.url, name="cam")
    reader = FrameReader(capture, clock, frame_s=PERIOD_S, latency_s=0.0, most_identical=0, timeout_s=5.0)
    until(lambda: reader.frames == len(stream.opening))
    reader.begin(6)
    seen = reader.reading()
    for clock.time_s in after(10.0, 6):
        before = reader.frames
        stream.show(videos.jpeg(videos.noise(50, 0)))
        until(lambda before=before: reader.frames > before)
    assert reader.reading().is_complete
    assert reader.reading().lost == 100
    assert (seen.frames, seen.lost, seen.is_complete) == (0, 0, False)
    stream.show(None)
    reader.close()


@pytest.mark.usefixtures("no_real_grace")
def test_a_stream_that_drops_most_of_its_pictures_is_told_of(connected, watch, clock, videos):
    camera = connected(timeout_s=5.0)
    watch(camera, [10.0], [videos.noise(50, 0)])
    camera.start_reading(3.0)
    for start_s in (10.0, 13.0, 16.0, 19.0):
        watch(camera, after(start_s, 4), [videos.noise(50, k) for k in range(4)])
    clock.time_s = 21.3
    assert camera.is_reading()
    clock.time_s = 21.5
    with pytest.raises(ReplyTimeoutError, match=r"of the 30 .* only 1\d have come .*, 78 others were missing"):
        camera.is_reading()


def test_damaged_picture_is_not_used(connected, watch, stream, clock, until, videos):
    camera = connected()
    watch(camera, [10.0], [videos.noise(50, 0)])
    camera.start_reading(0.2)
    whole = videos.jpeg(videos.noise(90, 1))
    clock.time_s = 10.1
    stream.show(whole[: len(whole) * 3 // 4])
    watch(camera, [10.2], [whole])
    assert camera.is_reading()
    watch(camera, [10.3], [videos.noise(90, 2)])
    assert not camera.is_reading()
    assert camera.frame().counts.mean() / 257 == pytest.approx(90, abs=1)
    assert camera.dropped_frames == 0, "it came, though damaged"


def test_picture_of_another_size_is_not_stretched(connected, watch, videos):
    camera = connected()
    watch(camera, [10.0], [videos.noise(50, 0)])
    camera.start_reading(0.1)
    watch(camera, [10.1], [videos.noise(50, 1, 32, 24)])
    with pytest.raises(DeviceFaultError, match="picture of 32 x 24 pixels came, where they should have 64 x 48"):
        camera.is_reading()


def test_end_of_the_stream_is_a_lost_link_and_can_be_opened_again(connected, watch, stream, until, videos):
    camera = connected()
    watch(camera, [10.0], [videos.noise(50, 0)])
    camera.start_reading(0.2)
    stream.show(None)
    with pytest.raises(NotConnectedError, match=r"stream.mjpg gives no more pictures, after 13: the stream ended"):
        until(lambda: not camera.is_reading())
    camera.start_reading(0.1)
    with pytest.raises(NotConnectedError, match="gives no more pictures"):
        until(lambda: not camera.is_reading())
    camera.reconnect()
    camera.connect()
    until(lambda: camera.frames == len(stream.opening))
    watch(camera, [10.1], [videos.noise(50, 2)])
    camera.start_reading(0.1)
    watch(camera, [10.2], [videos.noise(50, 1)])
    assert not camera.is_reading()


def test_stream_that_falls_silent_is_lost(connected, until):
    camera = connected(timeout_s=0.2)
    camera.start_reading(0.1)
    with pytest.raises(NotConnectedError, match="the stream ended or stood still"):
        until(lambda: not camera.is_reading())


@pytest.mark.usefixtures("no_real_grace")
def test_too_few_pictures_in_the_time(connected, watch, clock, videos):
    camera = connected(timeout_s=5.0)
    watch(camera, [10.0], [videos.noise(50, 0)])
    camera.start_reading(0.3)
    watch(camera, [10.1], [videos.noise(50, 1)])
    clock.time_s = 15.9
    assert camera.is_reading()
    clock.time_s = 16.1
    with pytest.raises(ReplyTimeoutError, match=r"of the 3 pictures of a reading of 0\.3 s only 1 have come"):
        camera.is_reading()


def test_picture_that_stands_still(connected, watch, videos):
    camera = connected(most_identical=3)
    still = videos.noise(50, 99)
    camera.start_reading(3600)
    watch(camera, after(9.9, 3), [still] * 3)
    assert camera_is_well(camera)
    watch(camera, [10.3], [still])
    with pytest.raises(DeviceFaultError, match="stands still: 4 in a row are the same bit for bit"):
        camera.is_reading()


@pytest.mark.parametrize("parameters", [{"most_identical": 3, "mean": 0}, {"most_identical": 0, "mean": 50}])
def test_the_dark_may_stand_still_and_so_may_a_camera_without_noise(connected, watch, videos, parameters):
    camera = connected(most_identical=parameters["most_identical"])
    still = np.zeros((48, 64), np.uint8) if parameters["mean"] == 0 else videos.noise(50, 99)
    camera.start_reading(0.5)
    watch(camera, after(9.9, 8), [still] * 8)
    assert not camera.is_reading()


def test_nobody_at_the_address(make_camera, stream):
    url = stream.url
    stream.server_close()
    with pytest.raises(NotConnectedError, match=r"cannot open http://127.0.0.1.*look at the camera's cable"):
        make_camera(url, timeout_s=0.5).connect()


def test_a_crash_while_pictures_are_taken_is_told(connected, watch, stream, until, videos, monkeypatch):
    camera = connected()
    monkeypatch.setattr(Capture, "_one_channel", lambda *_: 1 // 0)
    camera.start_reading(0.1)
    stream.show(videos.jpeg(videos.noise(50, 0)))
    with pytest.raises(DeviceFaultError, match="cam: taking pictures failed: ZeroDivisionError"):
        until(lambda: not camera.is_reading())


def test_close_while_reading_ends_the_thread(connected, until):
    camera = connected(timeout_s=0.2)
    camera.start_reading(0.5)
    camera.close()
    assert not [thread for thread in threading.enumerate() if thread.name == "pictures of cam"]
    assert not camera.is_reading()


def test_warm_up_that_does_not_come(make_camera, stream):
    camera = make_camera(stream.url, warm_up_frames=10, frame_s=0.001, timeout_s=1.0)
    stream.show(None)
    with pytest.raises(NotConnectedError, match="gives no more pictures"):
        camera.connect()


def test_nothing_of_opencv_stands_between_our_messages(stream, videos):
    """In a process of its own: FFmpeg looks only once how much it is to say."""
    whole = stream.opening[0]
    stream.opening += [whole[:500], whole]
    stream.show(None)
    script = (
        "from drivers.camera.capture import Capture\n"
        "from goniometer.errors import DeviceError\n"
        f"for address in ('none.avi', '99', {stream.url!r}, 'http://127.0.0.1:9/x'):\n"
        "    try:\n"
        "        capture = Capture(address, name='cam')\n"
        "        while True: capture.read()\n"
        "    except DeviceError as error:\n"
        "        print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert done.stderr == ""
    assert [line[:23] for line in done.stdout.splitlines()] == ["cam: OpenCV cannot open"] * 2 + [
        f"cam: {stream.url}"[:23],
        "cam: OpenCV cannot open",
    ]


@pytest.mark.parametrize(
    ("address", "shown"),
    [
        ("rtsp://me:secret@10.0.0.7:554/live?x=1", "rtsp://10.0.0.7:554/live?x=1"),
        ("http://10.0.0.7/stream.mjpg", "http://10.0.0.7/stream.mjpg"),
        ("/dev/video0", "/dev/video0"),
        ("a@b.avi", "a@b.avi"),
    ],
)
def test_passwords_are_not_shown(address, shown):
    assert without_password(address) == shown
