"""The camera's port: stills in their time and with their headers, refusals that say why, and no bytes that upset it."""

import json
import random

import cv2
import h11
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sim_devices.device import hang_up

HOST = b" HTTP/1.1\r\nHost: camera\r\n\r\n"


def get(target):
    return b"GET " + target.encode() + HOST


def answers(due, methods=()):
    """The responses in what is said, read by a client: time, status, headers and body of each."""
    client = h11.Connection(h11.CLIENT)
    found = []
    for due_s, said in due:
        if said is hang_up:
            continue
        client.send(h11.Request(method="GET", target="/", headers=[("Host", "x")]))
        client.send(h11.EndOfMessage())
        client.receive_data(said)
        response, body = client.next_event(), b""
        assert isinstance(response, h11.Response)
        while isinstance(event := client.next_event(), h11.Data):
            body += bytes(event.data)
        assert isinstance(event, h11.EndOfMessage)
        headers = {name.decode(): value.decode() for name, value in response.headers}
        found.append((due_s, response.status_code, headers, body))
        client = h11.Connection(h11.CLIENT)
    return found


def picture(body):
    return cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_UNCHANGED)


@pytest.fixture
def ask(device):
    """Ask for a target on a new connection; the one answer."""

    def ask_camera(target, now_s=0.0):
        (answer,) = answers(device.session().receive(get(target), now_s))
        return answer

    return ask_camera


@pytest.mark.parametrize("kind", ["png", "tiff"])
@pytest.mark.parametrize(
    ("bits", "dtype", "counts"), [(8, np.uint8, 255), (12, np.uint16, 4095), (16, np.uint16, 5010)]
)
def test_a_still_is_its_exposures_counts_and_is_due_when_it_is_read_out(ask, light, kind, bits, dtype, counts):
    due_s, status, headers, body = ask(f"/still.{kind}?exposure_s=0.05&gain_db=0&bits={bits}", 2.0)
    assert (due_s, status, headers["content-type"]) == (pytest.approx(2.08), 200, f"image/{kind}")
    assert light.middles_s == [2.025]
    assert picture(body).dtype == dtype
    assert_array_equal(picture(body), np.full((24, 32), counts))
    told = [headers[name] for name in ("x-frame-number", "x-exposure-start-s", "x-exposure-s", "x-gain-db")]
    assert [float(value) for value in told] == [1, 502.0, 0.05, 0]


def test_a_gain_multiplies_and_both_are_told_as_they_are_applied(ask, device):
    _, _, headers, body = ask("/still.png?exposure_s=0.01000004&gain_db=6.02&bits=16")
    assert (headers["x-exposure-s"], headers["x-gain-db"]) == ("0.010000", "6.0")
    assert device.camera.last.exposure.exposure_s == 0.01
    assert_array_equal(picture(body), round(1000 * 10**0.3) + 10)


def test_what_is_not_named_is_the_usual(ask):
    _, _, headers, body = ask("/still.png")
    assert float(headers["x-exposure-s"]) == 0.02
    assert_array_equal(picture(body), 2010)


def test_every_exposure_has_the_next_number_whoever_asked(device):
    numbers = []
    for now_s in (0.0, 1.0, 2.0):
        ((_, _, headers, _),) = answers(device.session().receive(get("/still.png"), now_s))
        numbers.append(headers["x-frame-number"])
    assert numbers == ["1", "2", "3"]


def test_the_status_says_what_it_can(ask):
    due_s, status, headers, body = ask("/status.json", 3.0)
    assert (due_s, status, headers["content-type"]) == (3.0, 200, "application/json")
    assert json.loads(body) == {
        "model": "simulated HTTP camera",
        "serial": "SC000001",
        "width": 32,
        "height": 24,
        "bits": [8, 12, 16],
        "exposure_s": [1e-5, 60.0],
        "gain_db": [0.0, 24.0],
        "readout_s": 0.03,
    }


@pytest.mark.parametrize(
    ("target", "status", "says"),
    [
        ("/still.png?exposure_s=0", 400, "exposure_s=0 cannot be had; allowed: 1e-05 to 60"),
        ("/still.png?exposure_s=nan", 400, "exposure_s=nan cannot be had"),
        ("/still.png?exposure_s=1_0", 400, "exposure_s=1_0 cannot be had"),
        ("/still.png?exposure_s=", 400, "exposure_s= cannot be had"),
        ("/still.png?exposure_s=1e999", 400, "cannot be had"),
        ("/still.png?gain_db=24.1", 400, "gain_db=24.1 cannot be had; allowed: 0 to 24"),
        ("/still.tiff?bits=9", 400, "bits=9 cannot be had; allowed: 8, 12, 16"),
        ("/still.png?exposure_s=%D9%A1", 400, "exposure_s=\\u0661 cannot be had"),
        ("/still.png?exposure=1", 400, "there is no exposure; allowed: exposure_s, gain_db, bits"),
        ("/still.png?bits=8&bits=12", 400, "bits is given twice"),
        ("/still.png?" + "a" * 600, 400, "longer than 512"),
        ("/stream.mjpg?bits=8", 400, "there is no bits; allowed: exposure_s, gain_db"),
        ("/stream.mjpg?exposure_s=99", 400, "exposure_s=99 cannot be had"),
        ("/", 404, "there are /still.png, /still.tiff, /status.json, /stream.mjpg"),
        ("/still.jpg", 404, "there is nothing here"),
    ],
)
def test_what_cannot_be_had_is_refused_with_what_can_and_no_picture_is_taken(ask, light, target, status, says):
    due_s, found, headers, body = ask(target, 1.0)
    assert (due_s, found) == (1.0, status)
    assert headers["content-type"].startswith("text/plain")
    assert says in body.decode("ascii")
    assert not light.middles_s


@pytest.mark.parametrize("method", [b"POST", b"PUT", b"DELETE", b"OPTIONS"])
def test_other_methods_are_not_allowed(device, method):
    ((_, status, headers, _),) = answers(device.session().receive(method + get("/still.png")[3:], 0.0))
    assert (status, headers["allow"]) == (405, "GET")


def test_who_asks_for_a_head_is_sent_no_body(device):
    ((_, said),) = device.session().receive(b"HEAD" + get("/still.png")[3:], 0.0)
    assert said.startswith(b"HTTP/1.1 405 ")
    assert said.endswith(b"\r\n\r\n")


def test_a_body_is_not_taken_for_a_request(device):
    post = b"POST /still.png HTTP/1.1\r\nHost: x\r\nContent-Length: 60\r\n\r\n" + get("/status.json").ljust(60)
    found = answers(device.session().receive(post + get("/status.json"), 0.0))
    assert [status for _, status, _, _ in found] == [405, 200]


def test_who_waits_to_be_asked_for_a_body_is_told_at_once_that_it_is_not_wanted(device):
    session = device.session()
    due = session.receive(b"PUT / HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\nExpect: 100-continue\r\n\r\n", 0.0)
    assert due[0][1].startswith(b"HTTP/1.1 405 ")
    assert due[-1][1] is hang_up


def test_another_still_is_refused_until_the_first_is_read_out(device):
    first, second = device.session(), device.session()
    first.receive(get("/still.png?exposure_s=1"), 0.0)
    ((due_s, status, _, body),) = answers(second.receive(get("/still.png"), 0.5))
    assert (due_s, status) == (0.5, 503)
    assert b"another still is being exposed or read out" in body
    ((_, status, headers, _),) = answers(second.receive(get("/still.png"), 1.03))
    assert (status, headers["x-frame-number"]) == (200, "2")


def test_requests_are_answered_whole_byte_by_byte_and_with_a_beginning_behind(device, feed):
    session = device.session()
    due = feed(session, get("/still.png"), trailing=b"GET /sta")
    assert [status for _, status, _, _ in answers(due)] == [200]


def test_requests_in_one_piece_are_answered_in_their_order(device):
    found = answers(device.session().receive(get("/still.png") + get("/status.json") + get("/still.png") + b"GE", 0.0))
    assert [status for _, status, _, _ in found] == [200, 200, 503]
    assert [due_s for due_s, _, _, _ in found] == [0.05, 0.05, 0.05]


@pytest.mark.parametrize(
    "data",
    [
        b"\x00\x01\x02\r\n\r\n",
        b"GET /still.png HTTP/1.1\r\n\r\n",
        b"GET /still.png HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n",
        b"GET /" + b"a" * 20_000,
        b"*IDN?\r\n\r\n",
    ],
)
def test_what_is_no_request_is_told_so_and_its_connection_ended(device, light, data):
    session = device.session()
    due = session.receive(data, 0.0)
    assert due[-1][1] is hang_up
    ((_, status, headers, body),) = answers(due)
    assert status in (400, 431)
    assert headers["connection"] == "close"
    assert b"this is no HTTP request" in body
    assert session.receive(get("/still.png"), 1.0) == []
    assert not light.middles_s


@pytest.mark.parametrize("asked", [b"HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", b"HTTP/1.0\r\n\r\n"])
def test_a_connection_ends_when_its_client_wants_no_more_of_it(device, asked):
    due = device.session().receive(b"GET /status.json " + asked, 0.0)
    assert due[0][1].startswith(b"HTTP/1.1 200 ")
    assert due[-1][1] is hang_up


def test_no_bytes_upset_it_and_it_keeps_little_of_them(device, light):
    chance = random.Random(7)
    seeds = [get("/still.png?exposure_s=0.1&bits=8"), get("/status.json"), b"POST / HTTP/1.1\r\nHost: x\r\n\r\nabc"]
    session, now_s, answered, ended = device.session(), 0.0, 0, 0
    for _ in range(10_000):
        now_s += 0.02
        data = bytearray(chance.choice(seeds))
        for _ in range(chance.randrange(3)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        if chance.random() < 0.1:
            del data[chance.randrange(1, len(data)) :]
        due = session.receive(bytes(data), now_s)
        assert all(due_s >= now_s for due_s, _ in due)
        assert len(bytes(session._connection.trailing_data[0])) <= 9000
        answered += any(said is not hang_up and said.startswith(b"HTTP/1.1 200 ") for _, said in due)
        if due and due[-1][1] is hang_up:
            session, ended = device.session(), ended + 1
    assert light.middles_s
    assert answered > 1000
    assert ended > 1000
