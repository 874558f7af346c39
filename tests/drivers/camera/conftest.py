"""A camera that serves still pictures, of the standard library's HTTP server, which misbehaves as a test asks it to."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

import cv2
import numpy as np
import pytest

from drivers.camera.http_still import HttpStillCamera
from drivers.camera.photometer import Photometer
from drivers.camera.region import Region
from drivers.camera.still_settings import StillSettings
from drivers.wire.link import Link

WIDTH, HEIGHT, BITS = 40, 30, 12
REGION = Region(5, 6, 20, 10)
WATTS = 2e-12


class SharedClock:
    """A clock that a test turns by hand and that the camera waits for."""

    def __init__(self) -> None:
        self._time_s, self._turned = 0.0, threading.Condition()

    def now(self) -> float:
        with self._turned:
            return self._time_s

    def sleep(self, duration_s: float) -> None:
        with self._turned:
            self._time_s += duration_s
            self._turned.notify_all()

    def wait_until(self, time_s: float) -> None:
        with self._turned:
            self._turned.wait_for(lambda: self._time_s >= time_s, 5)


@dataclass
class Answer:
    """What the camera sends; a test changes it."""

    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)
    body: bytes = b""
    announced: int | None = None
    sent: int | None = None
    chunked: bool = False
    closes: bool = False
    silent: bool = False


Misbehaviour = Callable[[Answer], None]


class StillServer(ThreadingHTTPServer):
    daemon_threads = True
    protocol = "HTTP/1.1"

    def __init__(self, clock: SharedClock) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.clock = clock
        self.port = f"socket://127.0.0.1:{self.server_address[1]}"
        self.counts = np.random.default_rng(5).integers(0, 4000, (HEIGHT, WIDTH)).astype(np.uint16)
        self.kind, self.number, self.ahead_s = ".png", 0, 1000.0
        self.status: dict[str, object] | bytes | None = {
            "model": "Still 1", "serial": "0815", "width": WIDTH, "height": HEIGHT, "bits": [8, 12, 16],
            "exposure_s": [1e-4, 10.0], "gain_db": [0.0, 24.0], "readout_s": 0.0,
        }  # fmt: skip
        self.once: list[Misbehaviour] = []
        self.always: list[Misbehaviour] = []
        self.paths: list[str] = []
        self.connections = 0
        self.early_s = 0.0
        """How long before the end of the exposure that it is asked for it answers, with an earlier picture."""

    @property
    def stills(self) -> list[str]:
        return [path for path in self.paths if path.startswith("/still")]

    def expose(self, path: str, start_s: float) -> Answer:
        query = {key: float(values[0]) for key, values in parse_qs(urlsplit(path).query).items()}
        self.clock.wait_until(start_s + (query["exposure_s"] - self.early_s))
        self.number += 1
        headers = {
            "Content-Type": "image/png",
            "X-Frame-Number": str(self.number),
            "X-Exposure-Start-s": f"{start_s + self.ahead_s:.6f}",
            "X-Exposure-s": f"{query['exposure_s']:.9g}",
            "X-Gain-dB": f"{query['gain_db']:g}",
        }
        counts = (self.counts >> 4).astype(np.uint8) if query["bits"] == 8 else self.counts
        return Answer(headers=headers, body=encoded(counts, self.kind))


class _Handler(BaseHTTPRequestHandler):
    server: StillServer
    disable_nagle_algorithm = True

    def setup(self) -> None:
        super().setup()
        self.protocol_version = self.server.protocol
        self.server.connections += 1

    def do_GET(self) -> None:
        server = self.server
        asked_s = server.clock.now()  # before a test can see the question, and turn the clock on
        server.paths.append(self.path)
        if self.path == "/status.json":
            self._send(self._status())
            return
        if not self.path.startswith("/still"):
            self._send(Answer(404, body=b"not here"))
            return
        answer = server.expose(self.path, asked_s)
        for change in [*server.always, *([server.once.pop(0)] if server.once else [])]:
            change(answer)
        self._send(answer)

    def _status(self) -> Answer:
        status = self.server.status
        if status is None:
            return Answer(404, body=b"no such page")
        body = status if isinstance(status, bytes) else json.dumps(status).encode()
        return Answer(headers={"Content-Type": "application/json"}, body=body)

    def _send(self, answer: Answer) -> None:
        if answer.silent:
            return
        self.send_response(answer.status)
        for name, value in answer.headers.items():
            self.send_header(name, value)
        body = answer.body[: answer.sent]
        if answer.chunked:
            self.send_header("Transfer-Encoding", "chunked")
            body = b"".join(b"%x\r\n%b\r\n" % (len(piece), piece) for piece in pieces(body)) + b"0\r\n\r\n"
        elif answer.announced != -1:
            self.send_header("Content-Length", str(answer.announced or len(answer.body)))
        self.end_headers()
        try:
            self.wfile.write(body)
        except OSError:
            self.close_connection = True
        if answer.closes or answer.announced == -1:
            self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 (its name in the standard library)
        """Say nothing."""


def encoded(counts: np.ndarray, kind: str) -> bytes:
    ok, data = cv2.imencode(kind, counts)
    assert ok
    return data.tobytes()


def pieces(body: bytes) -> list[bytes]:
    return [body[at : at + 100] for at in range(0, len(body), 100)]


@pytest.fixture
def clock() -> SharedClock:
    return SharedClock()


@pytest.fixture
def server(clock: SharedClock) -> Iterator[StillServer]:
    server = StillServer(clock)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.005}, daemon=True)
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join(5)


@pytest.fixture
def make_camera(server: StillServer, clock: SharedClock) -> Iterator[Callable[..., HttpStillCamera]]:
    links: list[Link] = []

    def make(*, most_saturated: float = 0.0, saturation_counts: int = 4095, **changes: object) -> HttpStillCamera:
        links.append(Link(server.port, device="camera", reply_timeout_s=2.0))
        photometer = Photometer(
            "camera",
            region=REGION,
            watts_per_count_per_s=WATTS,
            saturation_counts=saturation_counts,
            most_saturated=most_saturated,
        )
        settings = {"width": WIDTH, "height": HEIGHT, "bits": BITS} | changes
        return HttpStillCamera(links[-1], clock, photometer=photometer, settings=StillSettings(**settings))

    yield make
    for link in links:
        link.close()


@pytest.fixture
def camera(make_camera: Callable[..., HttpStillCamera]) -> HttpStillCamera:
    camera = make_camera()
    assert camera.connect() == ()
    return camera


@pytest.fixture
def take(clock: SharedClock) -> Callable[[HttpStillCamera, float], None]:
    """Take one reading, the clock going on as it does on a bench."""

    def take(camera: HttpStillCamera, exposure_s: float = 0.1) -> None:
        camera.start_reading(exposure_s)
        while camera.is_exposing() or camera.is_reading():
            clock.sleep(0.005)

    return take
