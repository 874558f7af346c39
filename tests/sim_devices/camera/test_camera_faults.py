"""Each fault of pictures spoils as many as it says, in its own way, and leaves those behind it alone."""

import http.client
import socket
import urllib.error
import urllib.request

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import ValidationError

from goniometer.errors import ConfigurationError
from sim_devices.bench import Bench
from sim_devices.effects.measurement import Moment
from sim_devices.faults.known import one_fault
from sim_devices.serving.clock import VirtualClock

FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
MARKED = {
    "size_mm": [60, 40],
    "markers": {"dictionary": "4x4_50", "size_mm": 8, "at_mm": {0: [-12, 6], 1: [12, 6], 2: [-12, -8], 3: [12, -8]}},
}
SHARP = {"width_px": 160, "height_px": 120, "focal_px": 300.0, "joules_per_count": 1.3e-14}


@pytest.fixture
def start(camera_scene):
    """Start a bench with a camera in virtual time, with faults."""
    benches = []

    def start(*faults, **parts):
        benches.append(Bench(camera_scene(faults=list(faults), **parts), VirtualClock()))
        benches[-1].start()
        benches[-1].world.axes["source_arm"].move(50.0, 0.0, **FAST)
        benches[-1].clock.sleep(10.0)
        return benches[-1]

    yield start
    for bench in benches:
        bench.stop()


def switch_on(bench, name, **keys):
    bench.faults.switch_on(one_fault.validate_python({"fault": name, "device": "camera", **keys}))


def still(bench, query="exposure_s=0.001&bits=12"):
    """A still's headers and file."""
    with urllib.request.urlopen(f"{bench.addresses['camera'].tcp}/still.png?{query}", timeout=10) as answer:
        return answer.headers, answer.read()


def picture(body):
    return cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_UNCHANGED)


def number(headers):
    return int(headers["X-Frame-Number"])


def test_corrupt_files_have_their_length_and_wrong_bytes(start):
    bench = start()
    _, sound = still(bench)
    switch_on(bench, "frame_corrupt", frames=2, wrong_bytes=5)
    for _ in range(2):
        headers, body = still(bench)
        assert len(body) == int(headers["Content-Length"]) == len(sound)
        assert np.count_nonzero(np.frombuffer(body, np.uint8) != np.frombuffer(sound, np.uint8)) == 5
    assert still(bench)[1] == sound


def test_a_file_that_is_cut_is_shorter_than_told_and_its_connection_ends(start):
    bench = start()
    _, sound = still(bench)
    switch_on(bench, "frame_cut", lost_bytes=30)
    with pytest.raises(http.client.IncompleteRead) as cut:
        still(bench)
    assert cut.value.partial == sound[:-30]
    assert cut.value.expected == 30
    assert still(bench)[1] == sound


def test_a_picture_of_the_wrong_size_is_a_part_of_the_right_one(start):
    bench = start()
    switch_on(bench, "frame_wrong_size")
    part, whole = picture(still(bench)[1]), picture(still(bench)[1])
    assert part.shape == (18, 24)
    assert_array_equal(part, whole[:18, :24])


def test_a_stale_picture_has_number_and_time_of_the_one_before(start):
    bench = start({"fault": "frame_stale", "device": "camera", "at_s": 20, "frames": 2})
    before, body = still(bench)
    bench.clock.sleep(20.0)
    for _ in range(2):
        stale, again = still(bench)
        assert again == body
        assert [stale[name] for name in ("X-Frame-Number", "X-Exposure-Start-s")] == ["1", before["X-Exposure-Start-s"]]
    assert number(still(bench)[0]) == 2


def test_a_shifted_picture_shows_the_bench_as_it_was_and_says_when(start):
    bench = start()
    camera = bench.world.devices["camera"].camera
    bench.world.axes["detector_arm"].move(40.0, 10.5, **FAST)
    bench.clock.sleep(2.0)
    now_s = bench.clock.now()
    switch_on(bench, "frame_time_shifted", early_s=2.0)
    early, late = (still(bench) for _ in "ab")
    assert float(early[0]["X-Exposure-Start-s"]) == pytest.approx(camera.zero_s + now_s - 2.0)
    assert [number(headers) for headers, _ in (early, late)] == [1, 2]
    assert bench.clock.now() == pytest.approx(now_s + 2 * 0.031)
    for (_, body), time_s in ((early, now_s - 2.0), (late, now_s)):
        counts = camera.light.power_w(Moment(time_s, 0.0)) * 0.001 / 1e-15
        assert_allclose(picture(body), np.minimum(np.rint(counts), 4095), atol=1)
    assert np.any(picture(early[1]) != picture(late[1]))


def test_a_dropped_picture_is_missed_in_the_numbers(start):
    bench = start()
    assert number(still(bench)[0]) == 1
    switch_on(bench, "frame_dropped")
    assert [number(still(bench)[0]) for _ in "ab"] == [3, 4]


@pytest.mark.parametrize(("share", "columns"), [(1.0, 48), (0.25, 12), (0.001, 1)])
def test_light_of_the_room_saturates_its_share_of_the_columns(start, share, columns):
    bench = start()
    switch_on(bench, "frame_saturated", share=share)
    lit, sound = (picture(still(bench, "exposure_s=0.00002&bits=12")[1]) for _ in "ab")
    assert sound.max() < 4095
    assert_array_equal(lit[:, :columns], 4095)
    assert_array_equal(lit[:, columns:], sound[:, columns:])


def test_behind_a_stuck_shutter_there_is_the_black_level(start):
    bench = start(camera={"sensor": {"dark_counts": 64.0}})
    switch_on(bench, "frame_dark", frames=2)
    pictures = [picture(still(bench)[1]) for _ in range(3)]
    assert_array_equal(pictures[:2], np.full((2, 36, 48), 64))
    assert pictures[2].max() > 64


def test_faults_of_one_kind_follow_each_other(start):
    bench = start(camera={"sensor": {"dark_counts": 64.0}})
    switch_on(bench, "frame_dark")
    switch_on(bench, "frame_saturated")
    pictures = [picture(still(bench)[1]) for _ in range(3)]
    # the one that was switched on last is the nearest: it spoils what the other has left
    assert_array_equal(pictures[0], 4095)
    assert pictures[2].min() >= 64


def found_markers(bench):
    body = still(bench, "exposure_s=0.02&gain_db=0&bits=8")[1]
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    _, numbers, _ = detector.detectMarkers(picture(body))
    return [] if numbers is None else sorted(numbers.ravel().tolist())


def test_markers_under_a_cloth_are_not_seen_until_it_is_gone(start):
    bench = start(plate=MARKED, camera=SHARP)
    assert found_markers(bench) == [0, 1, 2, 3]
    switch_on(bench, "markers_hidden", markers=[1, 2], for_s=30.0)
    bench.clock.sleep(0.1)
    assert found_markers(bench) == [0, 3]
    bench.clock.sleep(31.0)
    assert found_markers(bench) == [0, 1, 2, 3]


def test_a_misprinted_marker_is_seen_as_another(start):
    bench = start(plate=MARKED, camera=SHARP)
    switch_on(bench, "marker_misprinted", marker=1, shows=3)
    bench.clock.sleep(0.1)
    assert found_markers(bench) == [0, 2, 3, 3]


def test_a_pulled_cable_ends_connections_refuses_new_ones_and_is_plugged_in_again(start):
    bench = start()
    with socket.create_connection(("127.0.0.1", int(bench.addresses["camera"].tcp.rpartition(":")[2])), 5) as watching:
        watching.sendall(b"GET /stream.mjpg HTTP/1.1\r\nHost: x\r\n\r\n")
        assert watching.recv(15) == b"HTTP/1.1 200 OK"
        switch_on(bench, "cable_pulled", for_s=5.0)
        bench.clock.sleep(0.5)
        while watching.recv(65536):
            pass
    with pytest.raises((http.client.RemoteDisconnected, ConnectionResetError, urllib.error.URLError)):
        still(bench)
    bench.clock.sleep(5.0)
    assert picture(still(bench)[1]).shape == (36, 48)


def test_the_film_is_spoilt_as_stills_are(start, converse):
    bench = start({"fault": "frame_dropped", "device": "camera", "at_s": 0})
    film = converse(bench.world.devices["camera"])
    film.send(b"GET /stream.mjpg?exposure_s=0.001 HTTP/1.1\r\nHost: x\r\n\r\n", 10.0)
    said = b"".join(text for _, text in film.hear(10.2))
    assert [b"X-Frame-Number: %d\r\n" % count in said for count in (1, 2, 3)] == [False, True, True]


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ({"fault": "markers_hidden", "markers": [0]}, "markers_hidden: there is no marker 0 on the plate"),
        ({"fault": "marker_misprinted", "marker": 1, "shows": 2}, "there is no marker 1 on the plate"),
        ({"fault": "frame_dark", "device": "meter"}, "the fault frame_dark is of 'meter'"),
        ({"fault": "detector_saturated"}, "frame_saturated"),
    ],
)
def test_what_this_bench_cannot_have_is_refused(camera_scene, start, fault, says):
    fault = fault if fault["fault"] == "detector_saturated" else {"device": "camera"} | fault
    with pytest.raises(ValidationError, match=says):
        camera_scene(faults=[fault])
    with pytest.raises(ConfigurationError, match=says):
        start().faults.switch_on(one_fault.validate_python(fault))


def test_a_pattern_that_is_in_no_dictionary_is_refused(camera_scene):
    fault = {"fault": "marker_misprinted", "device": "camera", "marker": 1, "shows": 50}
    with pytest.raises(ValidationError, match="the dictionary 4x4_50 has no marker 50"):
        camera_scene(plate=MARKED, faults=[fault])


def test_only_a_camera_has_pictures_that_go_wrong(start):
    bench = start()
    with pytest.raises(ConfigurationError, match="arms is a newport_esp301, to which frame_dark cannot happen"):
        bench.faults.switch_on(one_fault.validate_python({"fault": "frame_dark", "device": "arms"}))
