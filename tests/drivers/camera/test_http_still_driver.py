from __future__ import annotations

import logging
import re
import socket

import cv2
import numpy as np
import pytest

from acquisition.protocols import Camera
from drivers.clock import Deadline
from drivers.wire.link import Link
from drivers.wire.wire_log import WireLog
from goniometer.errors import (
    DeviceFaultError,
    LimitError,
    NotConnectedError,
    ReplyError,
    ReplyTimeoutError,
    SaturatedError,
)

WATTS = 2e-12
IN_REGION = (slice(6, 16), slice(5, 25))


def reencoded(make_counts, kind=".png"):
    def change(answer):
        counts = cv2.imdecode(np.frombuffer(answer.body, np.uint8), cv2.IMREAD_UNCHANGED)
        answer.body = cv2.imencode(kind, make_counts(counts))[1].tobytes()

    return change


def header(name, value):
    def change(answer):
        answer.headers[name] = value(answer.headers[name]) if callable(value) else value

    return change


def without(*names):
    def change(answer):
        for name in names:
            del answer.headers[name]

    return change


def busy(answer):
    answer.status, answer.body, answer.headers = 503, b"an exposure is under way\n", {}


def cut(answer):
    answer.sent, answer.closes = 500, True


def corrupt(answer):
    middle = len(answer.body) // 2
    answer.body = answer.body[:middle] + bytes([answer.body[middle] ^ 8]) + answer.body[middle + 1 :]


def huge(answer):
    answer.announced = 10**12


def endless(answer):
    answer.chunked, answer.body = True, bytes(10**6)


def web_page(answer):
    answer.headers["Content-Type"], answer.body = "text/html", b"<html>Please log in</html>"


DOUBTFUL = {
    "cut": (cut, ReplyError, r"not complete \(peer closed connection without .*received 500 bytes"),
    "cut at once": (
        lambda answer: setattr(answer, "sent", 0) or setattr(answer, "closes", True),
        ReplyError,
        "0 bytes",
    ),
    "corrupt": (corrupt, ReplyError, r"a file that cannot be read: a checksum does not fit \(IDAT\)"),
    "page": (web_page, ReplyError, r"it is neither PNG nor TIFF \(beginning b'<html>Pl'\)"),
    "huge": (huge, ReplyError, "an answer of 1000000000000 bytes, where at most 70336 can be"),
    "endless": (endless, ReplyError, "more than the 70336 bytes that can be"),
    "size": (
        reencoded(lambda c: c[:, :-1]),
        ReplyError,
        "gray picture of 39 x 30 pixels of 16 bits in place of a gray",
    ),
    "colour": (reencoded(lambda c: np.dstack([c] * 3)), ReplyError, "a coloured picture of 40 x 30 pixels of 16 bits"),
    "8 bits": (reencoded(lambda c: (c >> 4).astype(np.uint8)), ReplyError, "of 8 bits in place of .* of 16 bits"),
    "left-aligned": (reencoded(lambda c: c << 4), ReplyError, "more than 12 bits hold: they are not right-aligned"),
    "no number": (header("X-Frame-Number", "seven"), ReplyError, "X-Frame-Number: 'seven', which is no such number"),
    "no time": (header("X-Exposure-Start-s", "nan"), ReplyError, "X-Exposure-Start-s: 'nan'"),
    "number left out": (without("X-Frame-Number"), ReplyError, "a picture without X-Frame-Number, which others have"),
    "time left out": (without("X-Exposure-Start-s"), ReplyError, "a picture without X-Exposure-Start-s, which others"),
    "all left out": (
        without("X-Frame-Number", "X-Exposure-Start-s", "X-Exposure-s", "X-Gain-dB"),
        ReplyError,
        "without X-Frame-Number, X-Exposure-Start-s, X-Exposure-s and X-Gain-dB, which others have",
    ),
    "exposure": (header("X-Exposure-s", "0.05"), DeviceFaultError, "taken with an exposure in s of 0.05 and not 0.1"),
    "gain": (header("X-Gain-dB", "6"), DeviceFaultError, "a gain in dB of 6 and not 0"),
    "busy": (busy, DeviceFaultError, "with error 503: an exposure is under way"),
    "stale": (
        header("X-Frame-Number", "2"),
        DeviceFaultError,
        "the camera has sent frame 2 once more: it shows an earl",
    ),
    "backwards": (
        header("X-Frame-Number", "1"),
        DeviceFaultError,
        "has sent frame 1 behind frame 2: it shows an earli",
    ),
    "shifted": (
        header("X-Exposure-Start-s", lambda start: f"{float(start) - 300:.6f}"),
        DeviceFaultError,
        r"the exposure began \d+(\.\d)? s before it was asked for: it shows another moment",
    ),
    "in future": (
        header("X-Exposure-Start-s", lambda start: f"{float(start) + 300:.6f}"),
        DeviceFaultError,
        r"the exposure ended \d+(\.\d)? s after it came",
    ),
}


@pytest.fixture
def one_doubt(request):
    return DOUBTFUL[request.param]


def test_it_is_a_camera(camera):
    assert isinstance(camera, Camera)


def test_connecting_takes_warm_up_frames_and_throws_them_away(make_camera, server):
    camera = make_camera(warm_up_frames=3)
    assert camera.connect() == ()
    assert camera.identity == "Still 1, serial 0815"
    assert server.paths == ["/status.json"] + ["/still.png?exposure_s=0.01&gain_db=0&bits=12"] * 3
    with pytest.raises(ReplyError, match="camera: there is no finished reading"):
        camera.power_w()


def test_reading(camera, server, clock, take):
    began_s = clock.now()
    take(camera, 0.25)
    counts = server.counts[IN_REGION].astype(float)
    np.testing.assert_allclose(camera.power_w(), counts.mean() / 0.25 * WATTS, rtol=1e-12)
    mean = camera.read()
    np.testing.assert_allclose([mean.mean_counts, mean.variance_counts2], [counts.mean(), counts.var()], rtol=1e-12)
    frame = camera.frame()
    np.testing.assert_array_equal(frame.counts, server.counts)
    assert (frame.counts.dtype, frame.bits, frame.exposure_s, frame.gain_db) == (np.uint16, 12, 0.25, 0.0)
    assert frame.number == server.number == 3
    assert began_s - 1e-4 <= frame.time_s <= clock.now() - 0.25 + 1e-4
    assert camera.dropped_frames == 0


def test_power_is_that_of_gain_0(make_camera, server, take):
    camera = make_camera(gain_db=20.0)
    camera.connect()
    take(camera, 0.1)
    assert server.paths[-1] == "/still.png?exposure_s=0.1&gain_db=20&bits=12"
    np.testing.assert_allclose(camera.power_w(), server.counts[IN_REGION].mean() / 10 / 0.1 * WATTS, rtol=1e-12)


@pytest.mark.parametrize("kind", [".png", ".tiff"])
@pytest.mark.parametrize("bits", [8, 12, 16])
def test_kinds_of_files(make_camera, server, take, kind, bits):
    server.kind = kind
    if bits == 16:
        server.counts = server.counts << 4
    camera = make_camera(bits=bits, still=f"/still{kind}?exposure_s={{exposure_s}}&gain_db={{gain_db}}&bits={{bits}}")
    assert camera.connect() == ()
    take(camera)
    assert camera.frame().counts.dtype == np.uint16
    np.testing.assert_array_equal(camera.frame().counts, server.counts >> 4 if bits == 8 else server.counts)


def test_light_is_collected_for_the_exposure_and_until_the_answer_begins(camera, clock, server, until):
    server.once.append(lambda answer: clock.wait_until(begun_s + 1.25))  # read-out
    begun_s = clock.now()
    camera.start_reading(1.0)
    until(lambda: len(server.stills) == 3)
    for time_s in (0.5, 0.999, 1.001, 1.2):
        clock.sleep(begun_s + time_s - clock.now())
        assert camera.is_exposing()
        assert camera.is_reading()
    clock.sleep(0.1)
    until(lambda: not camera.is_exposing())
    until(lambda: not camera.is_reading())
    np.testing.assert_allclose(camera.frame().time_s, begun_s, atol=1e-5)


HEADERS = "X-Frame-Number", "X-Exposure-Start-s", "X-Exposure-s", "X-Gain-dB"


@pytest.fixture
def read_early(server, clock, until):
    """Takes readings of 0.5 s whose pictures are seen to be whole so much before their exposures end."""

    def read(camera, early_s):
        server.early_s, asked = early_s, len(server.stills)
        camera.start_reading(0.5)
        while True:
            asked += 1
            until(lambda asked=asked: len(server.stills) == asked)
            clock.sleep(0.5 - early_s)
            until(camera._dialogue.is_whole)
            assert camera.is_exposing()
            clock.sleep(early_s)
            if not camera.is_reading():
                return
            clock.sleep(0.2)
            assert camera.is_reading()

    return read


@pytest.mark.parametrize("silent", [HEADERS, ()], ids=["without headers", "with headers"])
def test_a_picture_that_is_there_before_its_exposure_can_have_ended_is_an_old_one(
    make_camera, server, take, read_early, silent
):
    server.always.append(without(*silent))
    camera = make_camera()
    camera.connect()
    with pytest.raises(DeviceFaultError, match=r"whole picture had come 0\.2 s after .* before 0\.5 s of exposure can"):
        read_early(camera, 0.3)
    assert len(server.stills) == 2 + 3
    server.early_s = 0.0
    take(camera, 0.5)
    np.testing.assert_array_equal(camera.frame().counts, server.counts)


@pytest.mark.parametrize(("early_s", "step_s"), [(0.004, 1e-6), (0.05, 0.1)], ids=["a tick", "half of its step"])
def test_a_picture_may_be_as_much_too_soon_as_is_rounded(make_camera, server, read_early, early_s, step_s):
    server.always.append(without(*HEADERS))
    camera = make_camera(exposure_step_s=step_s)
    camera.connect()
    read_early(camera, early_s)
    assert len(server.stills) == 2 + 1


def test_an_early_picture_that_nobody_has_looked_for_is_taken(make_camera, server, clock, until):
    server.always.append(without(*HEADERS))
    camera = make_camera()
    camera.connect()
    server.early_s = 0.5
    camera.start_reading(0.5)
    until(lambda: len(server.stills) == 3)
    clock.sleep(0.5)
    until(lambda: not camera.is_reading())
    assert len(server.stills) == 3


@pytest.mark.parametrize("one_doubt", DOUBTFUL, indirect=True)
def test_a_doubtful_picture_is_taken_again(camera, server, take, one_doubt, caplog):
    server.once += [one_doubt[0]] * 2
    with caplog.at_level(logging.WARNING, "drivers.camera.http_still"):
        take(camera)
    np.testing.assert_array_equal(camera.frame().counts, server.counts)
    assert camera.frame().number == 5
    assert len(caplog.messages) == 2
    assert camera.dropped_frames == 0


@pytest.mark.parametrize("one_doubt", DOUBTFUL, indirect=True)
def test_a_picture_doubtful_for_the_third_time_is_refused(camera, server, take, one_doubt):
    change, kind, message = one_doubt
    server.always.append(change)
    with pytest.raises(kind, match=f"camera: .*{message}"):
        take(camera)
    assert len(server.stills) == 2 + 3
    assert not camera.is_exposing()
    with pytest.raises(ReplyError, match="there is no finished reading"):
        camera.frame()
    server.always.clear()
    take(camera)
    np.testing.assert_array_equal(camera.frame().counts, server.counts)


def test_a_picture_is_asked_for_again_after_a_moment(camera, server, clock, until):
    server.once.append(busy)
    camera.start_reading(0.1)
    until(lambda: len(server.stills) == 3)
    clock.sleep(0.1)
    until(lambda: camera.is_reading() and camera.is_exposing() and camera._again_s is not None)
    clock.sleep(0.19)
    assert camera.is_reading()
    assert len(server.stills) == 3
    clock.sleep(0.02)
    assert camera.is_reading()
    until(lambda: len(server.stills) == 4)


def test_what_the_camera_refuses_is_told_in_its_words_and_not_repeated(camera, server, take):
    def refuse(answer):
        answer.status, answer.body = 400, b"bits: got 12;\r\n allowed: 8, 16"

    server.always.append(refuse)
    with pytest.raises(LimitError, match=r"with error 400: bits: got 12; allowed: 8, 16. Not done: no picture"):
        take(camera)
    assert len(server.stills) == 2 + 1


def closing(answer):
    answer.headers["Connection"], answer.closes = "close", True


WAYS = {
    "as it should": ("HTTP/1.1", lambda answer: None, 1),
    "closing": ("HTTP/1.1", closing, 4),
    "closing without a word": ("HTTP/1.1", lambda answer: setattr(answer, "closes", True), 4),
    "until it closes": ("HTTP/1.1", lambda answer: setattr(answer, "announced", -1), 4),
    "chunked": ("HTTP/1.1", lambda answer: setattr(answer, "chunked", True), 1),
    "old": ("HTTP/1.0", lambda answer: None, 5),
    "old until it closes": ("HTTP/1.0", lambda answer: setattr(answer, "announced", -1), 5),
}


@pytest.mark.parametrize("way", WAYS)
def test_ways_to_send_a_picture(make_camera, server, take, way):
    server.protocol, change, connections = WAYS[way]
    server.always.append(change)
    camera = make_camera()
    assert camera.connect() == ()
    for _ in range(2):
        take(camera)
        np.testing.assert_array_equal(camera.frame().counts, server.counts)
    assert server.connections == connections


def test_a_camera_that_says_little_is_taken_with_notes(make_camera, server, take):
    server.status = None
    server.always.append(without(*HEADERS))
    camera = make_camera()
    notes = camera.connect()
    assert "no /status.json" in notes[0]
    assert [re.search(r"say (\S+):", note)[1] for note in notes[1:]] == [*HEADERS]
    take(camera)
    frame = camera.frame()
    assert (camera.identity, frame.exposure_s, frame.number) == ("", 0.1, None)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"width": 41, "bits": [8, 10]}, r"have 41 x 30 pixels, not 40 x 30 .*; it gives 8 or 10 bits, not 12"),
        ({"gain_db": [1, 2]}, r"its gain goes from 1 to 2 dB, not to 0 dB \(gain_db\)"),
    ],
)
def test_another_camera_than_the_rig_file_describes(make_camera, server, changes, message):
    server.status |= changes
    with pytest.raises(DeviceFaultError, match=message):
        make_camera().connect()
    assert server.stills == []


@pytest.mark.parametrize(
    "status", [b'{"width": 4', b"[]", b'{"width": "4"}', b'{"bits": 8}', b'{"gain_db": [3]}', b"\xff"]
)
def test_a_broken_status_is_refused(make_camera, server, status):
    server.status = status
    with pytest.raises(ReplyError, match=r"a status.json that cannot be read"):
        make_camera().connect()


def test_another_camera_after_the_link_was_lost_is_refused(camera, server):
    server.status["serial"] = "0816"
    camera.reconnect()
    with pytest.raises(DeviceFaultError, match=r"another device answers .*0816.*0815"):
        camera.connect()


@pytest.mark.parametrize("exposure_s", [0.0, -1.0, 9e-5, 10.1, float("nan"), float("inf")])
def test_an_exposure_that_the_camera_has_not_is_refused_before_the_first_byte(camera, server, exposure_s):
    with pytest.raises(LimitError, match=re.escape(f"an exposure of {exposure_s:g} s is not between 0.0001 and 10 s")):
        camera.start_reading(exposure_s)
    assert len(server.stills) == 2
    assert not camera.is_reading()


def test_frames_that_others_have_taken_are_counted_and_told(camera, server, take):
    take(camera)
    server.number += 5
    take(camera)
    assert camera.dropped_frames == 5
    assert camera.frame().number == 9
    assert camera.connect() == ("5 frames were dropped, or taken by another program",)
    assert camera.dropped_frames == 0


def test_frames_of_questions_that_were_repeated_are_not_dropped(camera, server, take):
    server.once += [cut, cut]
    take(camera)
    assert camera.dropped_frames == 0


def test_a_camera_that_was_switched_off_counts_and_times_from_the_beginning(camera, server, take):
    take(camera)
    server.number, server.ahead_s = 0, -7.0
    camera.reconnect()
    assert camera.connect() == ()
    take(camera)
    assert camera.frame().number == 3


def test_saturated_pixels_are_no_reading_but_a_picture(make_camera, server, take):
    server.counts[10, 10] = server.counts[11, 10] = 4095
    server.counts[0, 0] = 4095  # outside of the region
    camera = make_camera()
    camera.connect()
    take(camera)
    for reading in (camera.power_w, camera.read):
        with pytest.raises(SaturatedError, match=r"2 of the region's 200 pixels have 4095 counts or more at 0.1 s"):
            reading()
    assert camera.frame().counts[10, 10] == 4095


@pytest.mark.parametrize(("share", "is_refused"), [(0.01, False), (0.0099, True)])
def test_a_share_of_saturated_pixels_may_be_allowed(make_camera, server, take, share, is_refused):
    server.counts[IN_REGION] = 100
    server.counts[10, 10:12] = 3900
    camera = make_camera(most_saturated=share, saturation_counts=3900)
    camera.connect()
    take(camera)
    if is_refused:
        with pytest.raises(SaturatedError, match="2 of the region's 200"):
            camera.power_w()
    else:
        assert (camera.read().mean_counts, camera.read().pixels) == (100.0, 198)


def test_a_camera_that_hangs_up_between_pictures_is_called_again(camera, server, take):
    server.once.append(lambda answer: setattr(answer, "closes", True))
    for _ in range(3):
        take(camera)
        np.testing.assert_array_equal(camera.frame().counts, server.counts)
    assert server.connections == 2


def test_a_camera_that_was_unplugged_is_not_connected(camera, server, take):
    server.once.append(cut)
    server.shutdown()
    server.socket.close()
    with pytest.raises(NotConnectedError, match=r"camera: port .* cannot be opened"):
        take(camera)


def test_a_silent_camera_is_a_timeout(camera, server, take, monkeypatch):
    monkeypatch.setattr(Deadline, "_REAL_GRACE_S", 0.0)
    server.always.append(lambda answer: setattr(answer, "silent", True))
    with pytest.raises(ReplyTimeoutError, match=r"camera: no whole picture came .* 0.1 s of exposure, 3 times"):
        take(camera)


def test_a_silent_camera_is_not_connected_to(make_camera, server, monkeypatch):
    monkeypatch.setattr(Deadline, "_REAL_GRACE_S", 0.0)
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        server.port = f"socket://127.0.0.1:{nobody.getsockname()[1]}"
        with pytest.raises(ReplyTimeoutError, match=r"no answer to '/status.json'"):
            make_camera().connect()


def test_the_picture_of_a_reading_given_up_is_not_taken_for_the_next_one(camera, server, clock, take, until):
    camera.start_reading(5.0)
    until(lambda: len(server.stills) == 3)
    take(camera, 0.1)
    assert (camera.frame().exposure_s, server.connections) == (0.1, 2)


def test_the_wire_log_holds_the_beginning_of_a_picture_only(server, clock, tmp_path):
    log = WireLog(tmp_path / "wire.log", clock)
    link = Link(server.port, device="camera", wire_log=log, most_logged=100)
    for _ in range(2):
        link.write(b"GET /nowhere HTTP/1.1\r\nHost: a\r\n\r\n")
        link.read(lambda received: received.endswith(b"not here") or None)
        link._received.clear()
    link.close()
    log.close()
    lines = [line.split("\t") for line in (tmp_path / "wire.log").read_text().splitlines()]
    came = [len(bytes.fromhex(line[5])) for line in lines if line[3] == "<"]
    assert sum(came) == 200
    assert [line[4] for line in lines if line[3] == "!"][1].endswith("more bytes came and are not written here")
