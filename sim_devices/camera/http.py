"""The port of a simulated camera: stills, a film and what it is, over HTTP/1.1."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from http import HTTPStatus

import h11

from sim_devices.camera.camera import Camera, File
from sim_devices.camera.exposure import Refused
from sim_devices.camera.film import HEAD, Film
from sim_devices.device import Due, hang_up

_LONGEST_HEAD_BYTES = 8192
_ALLOWED = "exposure_s", "gain_db", "bits"
_FILMED = "exposure_s", "gain_db"
_FILM_BITS = 8
_STILLS = {"/still.png": "png", "/still.tiff": "tiff"}


class HttpCamera:
    """A camera that serves stills and a film.

    Parameters
    ----------
    camera : Camera
        What takes the pictures; faults of frames wrap what it does.
    serial : str
        Its serial number.
    """

    def __init__(self, camera: Camera, serial: str) -> None:
        self.camera, self._serial = camera, serial

    def session(self) -> HttpSession:
        """A new connection."""
        return HttpSession(self)

    def status(self) -> bytes:
        """What it is and can, as JSON."""
        camera = self.camera
        said = {
            "model": "simulated HTTP camera",
            "serial": self._serial,
            "width": camera.width,
            "height": camera.height,
            "bits": camera.means.bits,
            "exposure_s": camera.means.exposure_s,
            "gain_db": camera.means.gain_db,
            "readout_s": camera.readout_s,
        }
        return json.dumps(said).encode()


class HttpSession:
    """A connection; answers have the order of the requests, and a request is judged when it has arrived.

    Parameters
    ----------
    device : HttpCamera
        What answers.
    """

    def __init__(self, device: HttpCamera) -> None:
        self._device, self._camera = device, device.camera
        self._connection = h11.Connection(h11.SERVER, max_incomplete_event_size=_LONGEST_HEAD_BYTES)
        self._request = h11.Request(method="GET", target="/", headers=[("Host", "")])
        self._has_ended = False
        self._last_s = float("-inf")

    def receive(self, data: bytes, now_s: float) -> list[Due]:
        """Answer every request that is complete; what comes after the last one of a connection is not heard."""
        due: list[Due] = []
        if self._has_ended or not data:
            return due
        self._connection.receive_data(data)
        while not self._has_ended:
            try:
                event = self._connection.next_event()
            except h11.RemoteProtocolError as error:
                self._request = h11.Request(method="GET", target="/", headers=[("Host", "")])
                return due + self._ended(error.error_status_hint, f"this is no HTTP request: {error}", now_s)
            if event is h11.NEED_DATA or event is h11.PAUSED:
                break
            if isinstance(event, h11.Request):
                self._request = event
            if isinstance(event, h11.EndOfMessage):
                due += self._answered(now_s)
            elif self._connection.they_are_waiting_for_100_continue:
                due += self._ended(405, "only GET is understood, and it has no body", now_s)
        return due

    def _answered(self, now_s: float) -> list[Due]:
        path, _, query = self._request.target.decode("ascii").partition("?")
        try:
            if path not in ("/status.json", "/stream.mjpg", *_STILLS):
                known = ", ".join((*_STILLS, "/status.json", "/stream.mjpg"))
                raise Refused(404, f"there is nothing here; there are {known}")
            if self._request.method != b"GET":
                raise Refused(405, "only GET is understood")
            if path == "/stream.mjpg":
                return self._filmed(query, now_s)
            if path == "/status.json":
                said = self._device.status()
                return self._said(200, [("Content-Type", "application/json")], File(said, len(said)), now_s)
            return self._still(_STILLS[path], query, now_s)
        except Refused as refused:
            return self._words(refused.status, str(refused), now_s)

    def _still(self, kind: str, query: str, now_s: float) -> list[Due]:
        exposure = self._camera.means.exposure(query, now_s, _ALLOWED)
        picture = self._camera.still(exposure)
        headers = [("Content-Type", f"image/{kind}"), *self._camera.headers(picture)]
        return self._said(200, headers, self._camera.file(picture, kind), self._camera.ready_s(exposure))

    def _filmed(self, query: str, now_s: float) -> list[Due]:
        """The connection's last answer; what its client says from then on is not heard."""
        means = replace(self._camera.means, bits=(_FILM_BITS,))
        begin_s = max(now_s, self._last_s)
        film = Film(self._camera, means.exposure(query, begin_s, _FILMED))
        self._has_ended = True
        return [(begin_s, HEAD), film.next()]

    def _ended(self, status: int, text: str, now_s: float) -> list[Due]:
        return self._words(status, text, now_s, closes=True)

    def _words(self, status: int, text: str, now_s: float, *, closes: bool = False) -> list[Due]:
        said = text.encode("ascii", "backslashreplace") + b"\n"
        headers = [("Content-Type", "text/plain; charset=us-ascii"), *([("Allow", "GET")] if status == 405 else [])]
        return self._said(status, headers, File(said, len(said)), now_s, closes=closes)

    def _said(
        self, status: int, headers: Sequence[tuple[str, str]], file: File, due_s: float, *, closes: bool = False
    ) -> list[Due]:
        """An answer in one piece, after those before it; where a file is cut, its connection ends."""
        connection = self._connection
        length = [("Content-Length", str(file.said_bytes)), *([("Connection", "close")] if closes else [])]
        response = h11.Response(status_code=status, headers=[*headers, *length], reason=HTTPStatus(status).phrase)
        said = connection.send(response)
        if self._request.method != b"HEAD":
            said += connection.send(h11.Data(data=file.content))
        if len(file.content) == file.said_bytes:
            connection.send(h11.EndOfMessage())
        self._last_s = due_s = max(due_s, self._last_s)
        self._has_ended = closes or connection.our_state is not h11.DONE
        if not self._has_ended:
            connection.start_next_cycle()
        return [(due_s, said), (due_s, hang_up)] if self._has_ended else [(due_s, said)]
