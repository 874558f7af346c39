"""Videos for the tests: files, and a camera that serves JPEG pictures over HTTP when a test says so."""

from __future__ import annotations

import http.server
import queue
import threading
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from drivers.camera.photometer import Photometer
from drivers.camera.region import Region
from drivers.camera.video import VideoCamera

WIDTH, HEIGHT = 64, 48
PROBED = 12  # FFmpeg looks at so many pictures before it says that a stream is there


def noise(mean, seed, width=WIDTH, height=HEIGHT):
    return np.random.default_rng(seed).integers(mean - 9, mean + 10, (height, width)).astype(np.uint8)


def write_video(path, pictures, frames_per_s=10.0):
    """Lossless."""
    is_colour = pictures[0].ndim == 3
    height, width = pictures[0].shape[:2]
    codec = cv2.VideoWriter_fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, codec, frames_per_s, (width, height), is_colour)
    assert writer.isOpened()
    for picture in pictures:
        writer.write(picture)
    writer.release()
    return str(path)


def jpeg(picture):
    return cv2.imencode(".jpg", picture)[1].tobytes()


def decoded(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


class Stream(http.server.ThreadingHTTPServer):
    """Serves `opening` to whoever comes, then what `show` is given; None ends the stream, silence keeps it waiting."""

    daemon_threads = True

    def __init__(self):
        super().__init__(("127.0.0.1", 0), _Pictures)
        self.opening = [jpeg(noise(100, seed)) for seed in range(PROBED)]
        self.shown = queue.SimpleQueue()
        self.url = f"http://127.0.0.1:{self.server_address[1]}/stream.mjpg"
        self._thread = threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True)
        self._thread.start()

    def show(self, data):
        self.shown.put(data)

    def close(self):
        self.shown.put(None)
        self.shutdown()
        self._thread.join(5)
        self.server_close()

    def handle_error(self, request, client_address):
        """A client that has hung up is no error."""


class _Pictures(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace;boundary=frame")
        self.end_headers()
        for data in self.server.opening:
            self._send(data)
        while (data := self.server.shown.get()) is not None:
            self._send(data)

    def _send(self, data):
        head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
        self.wfile.write(head.encode() + data + b"\r\n")

    def log_message(self, *_):
        """Nobody reads it."""


@pytest.fixture
def videos():
    return SimpleNamespace(noise=noise, write=write_video, jpeg=jpeg, decoded=decoded)


@pytest.fixture
def stream():
    server = Stream()
    yield server
    server.close()


@pytest.fixture
def make_camera(clock):
    """A camera read over columns 8 to 23 and rows 4 to 15, with a picture every 0.1 s."""
    cameras = []

    def make(address, size=(WIDTH, HEIGHT), most_saturated=0.0, **parameters):
        photometer = Photometer(
            "cam",
            region=Region(8, 4, 16, 12),
            watts_per_count_per_s=1e-12,
            saturation_counts=65535,
            most_saturated=most_saturated,
        )
        cameras.append(VideoCamera(address, clock, photometer, size=size, **{"frame_s": 0.1} | parameters))
        return cameras[-1]

    yield make
    for camera in cameras:
        camera.close()
