"""The film: whole parts at the camera's pace, numbers that show what was lost, and clients of other people."""

import http.client
import re
import socket
import time
import urllib.error
import urllib.request

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sim_devices.camera.camera import File
from sim_devices.device import Passing
from sim_devices.faults.faulty_port import FaultyPort, FaultySession
from sim_devices.serving.clock import ScaledClock, VirtualClock
from sim_devices.serving.reactor import Reactor

HOST = b" HTTP/1.1\r\nHost: camera\r\n\r\n"
PART = re.compile(rb"--frame\r\n(.*?)\r\n\r\n", re.DOTALL)


def parts(data):
    """The whole parts of a film's bytes, with their headers; everything between must be a part."""
    found = []
    while (head := PART.match(data)) is not None:
        headers = dict(line.split(": ") for line in head[1].decode("ascii").split("\r\n"))
        end = head.end() + int(headers["Content-Length"])
        if end + 2 > len(data):
            break
        assert data[end : end + 2] == b"\r\n"
        found.append((headers, data[head.end() : end]))
        data = data[end + 2 :]
    assert b"--frame".startswith(data[:7]) or PART.match(data) or b"\r\n\r\n" not in data
    return found


def numbers(data):
    return [int(headers["X-Frame-Number"]) for headers, _ in parts(data)]


@pytest.fixture
def begin(device, converse):
    """Begin a film; the conversation."""

    def begin_film(query="?exposure_s=0.01"):
        film = converse(device)
        film.send(b"GET /stream.mjpg" + query.encode() + HOST, 0.0)
        return film

    return begin_film


@pytest.fixture
def reactors():
    """Those that serve; they are stopped after the test, and an error in them fails it."""
    serving = []
    yield serving
    for reactor in serving:
        reactor.stop()
        reactor.raise_failure()


@pytest.fixture
def serve(device, reactors):
    """Serve the camera on a clock; its port."""

    def start(clock):
        reactors.append(Reactor(clock))
        clock.attach(reactors[-1])
        port = reactors[-1].listen(device)
        reactors[-1].start()
        return port

    return start


def test_frames_come_at_the_cameras_pace_each_when_it_has_been_read_out(begin, light):
    heard = begin("?exposure_s=0.01&gain_db=6").hear(0.2)
    head = heard.pop(0)
    assert head[0] == 0.0
    assert b"Content-Type: multipart/x-mixed-replace;boundary=frame\r\n" in head[1]
    assert [due_s for due_s, _ in heard] == pytest.approx([0.04, 0.09, 0.14, 0.19])
    assert light.middles_s == pytest.approx([0.005, 0.055, 0.105, 0.155])
    headers, jpeg = parts(heard[1][1])[0]
    assert headers == {
        "Content-Type": "image/jpeg",
        "Content-Length": str(len(jpeg)),
        "X-Frame-Number": "2",
        "X-Exposure-Start-s": "500.050000",
        "X-Exposure-s": "0.010000",
        "X-Gain-dB": "6.0",
    }
    assert_array_equal(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED), np.full((24, 32), 255))


def test_long_exposures_slow_it_down(begin):
    assert [due_s for due_s, _ in begin("?exposure_s=0.2").hear(0.8)[1:]] == pytest.approx([0.23, 0.46, 0.69])


def test_a_still_takes_the_sensor_from_the_frame_under_way_and_has_a_number_of_its_own(begin, device):
    film = begin()
    film.hear(0.1)
    ((due_s, still),) = device.session().receive(b"GET /still.png?exposure_s=0.1" + HOST, 0.105)
    assert due_s == pytest.approx(0.235)
    assert b"X-Frame-Number: 3\r\n" in still
    heard = film.hear(0.36)
    assert [when_s for when_s, _ in heard] == pytest.approx([0.275, 0.325])
    assert numbers(b"".join(said for _, said in heard)) == [4, 5]


def test_what_a_client_says_while_it_watches_is_not_heard(device):
    session = device.session()
    assert len(session.receive(b"GET /stream.mjpg" + HOST + b"GET /status.json" + HOST, 0.0)) == 2
    assert session.receive(b"GET /status.json" + HOST, 1.0) == []


def test_a_film_behind_a_still_begins_after_it(device):
    still, head, film = device.session().receive(b"GET /still.png" + HOST + b"GET /stream.mjpg" + HOST, 0.0)
    assert [still[0], head[0], film[0]] == pytest.approx([0.05, 0.05, 0.1])


def received(client, enough, give_up_s=5.0):
    data, end_s = b"", time.monotonic() + give_up_s
    client.settimeout(give_up_s)
    while not enough(data):
        assert time.monotonic() < end_s
        data += client.recv(65536)
    return data


def begun(port):
    client = socket.socket()
    # so that little of the film has room outside the bench
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.connect(("127.0.0.1", port))
    client.sendall(b"GET /stream.mjpg?exposure_s=0.01" + HOST)
    received(client, lambda data: data.endswith(b"\r\n\r\n"))
    return client


def test_after_a_long_wait_the_newest_frame_comes_and_no_time_is_spent_on_those_before(serve, light):
    clock = VirtualClock()
    with begun(serve(clock)) as client:
        began_s = time.monotonic()
        clock.sleep(50.0)
        data = received(client, lambda data: len(parts(data)) == 1)
        assert numbers(data) in ([999], [1000])
        assert len(light.middles_s) == 1
        assert light.middles_s[0] == pytest.approx(50.0, abs=0.1)
        assert time.monotonic() - began_s < 1.0


def drained(client, clock):
    """All that there is for a client now."""
    data = b""
    client.settimeout(0.05)
    while True:
        clock.sleep(0.0)
        try:
            data += client.recv(1 << 20)
        except TimeoutError:
            return data


def test_a_client_that_does_not_read_loses_whole_frames_and_sees_it_by_their_numbers(serve, device, light, reactors):
    clock = VirtualClock()
    # frames that soon fill what the system keeps for a connection
    device.camera.file = lambda picture, kind: File(b"x" * 100_000, 100_000)
    with begun(serve(clock)) as client:
        for _ in range(400):
            clock.sleep(0.05)
        (link,) = reactors[0]._clients._links
        assert len(link.unsent) < 65536 + 101_000
        assert len(light.middles_s) < 200, "frames are made that nobody is sent"
        data = drained(client, clock)
        clock.sleep(0.05)
        found = numbers(data + drained(client, clock))
        assert len(found) == len(light.middles_s)
        assert np.all(np.diff(found[:-1]) == 1)
        assert found[-1] - found[-2] > 200


def test_at_a_broken_port_too_only_the_newest_frame_is_made(device, light):
    port = FaultyPort(is_virtual=True)
    (_, _), (_, film) = FaultySession(device.session(), port).receive(b"GET /stream.mjpg" + HOST, 0.0)
    assert isinstance(film, Passing)
    ((next_s, film),) = film.passed(10.01)
    assert not light.middles_s
    assert next_s == pytest.approx(10.0)
    (_, frame), (_, film) = film(next_s)
    assert b"X-Frame-Number: 200\r\n" in frame
    # also what follows then goes through the port
    port.disturb(lambda *_: [], None, 1)
    ((next_s, film),) = film.passed(20.01)
    assert [said for _, said in film(next_s) if isinstance(said, bytes)] == []


def test_a_file_that_is_cut_ends_the_film(begin, device):
    film = begin()
    device.camera.file = lambda picture, kind: File(b"x" * 100, 200)
    heard = film.hear(10.0)
    assert len(heard) == 2
    assert b"Content-Length: 200\r\n" in heard[1][1]


@pytest.fixture
def url(serve):
    """The camera at real time."""
    return f"http://127.0.0.1:{serve(ScaledClock(1))}"


def test_opencv_opens_the_film_at_real_time(url):
    began_s = time.monotonic()
    film = cv2.VideoCapture(f"{url}/stream.mjpg?exposure_s=0.001")
    assert film.isOpened()
    frames = [film.read() for _ in range(5)]
    film.release()
    assert time.monotonic() - began_s < 5.0
    assert all(is_read for is_read, _ in frames)
    assert_array_equal(frames[-1][1], np.full((24, 32, 3), 110))


def test_ordinary_clients_read_stills_and_refusals(url):
    with urllib.request.urlopen(f"{url}/still.png?exposure_s=0.01&bits=16", timeout=5) as answer:
        counts = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_UNCHANGED)
        assert answer.headers["X-Exposure-s"] == "0.010000"
    assert_array_equal(counts, np.full((24, 32), 1010))
    with pytest.raises(urllib.error.HTTPError, match="400: Bad Request") as refused:
        urllib.request.urlopen(f"{url}/still.png?bits=7", timeout=5)
    with refused.value:
        assert b"bits=7 cannot be had" in refused.value.read()


def test_one_connection_serves_one_still_after_the_other(url):
    client = http.client.HTTPConnection(url.removeprefix("http://"), timeout=5)
    numbers_told = []
    for kind in ("png", "tiff", "png"):
        client.request("GET", f"/still.{kind}?exposure_s=0.001")
        answer = client.getresponse()
        assert len(answer.read()) == int(answer.headers["Content-Length"])
        numbers_told.append(answer.headers["X-Frame-Number"])
    client.close()
    assert numbers_told == ["1", "2", "3"]


def test_a_connection_is_ended_after_a_file_that_was_cut(url, device):
    device.camera.file = lambda picture, kind: File(b"x" * 100, 200)
    with pytest.raises(http.client.IncompleteRead) as cut:
        urllib.request.urlopen(f"{url}/still.png?exposure_s=0.001", timeout=5).read()
    assert (len(cut.value.partial), cut.value.expected) == (100, 100)
