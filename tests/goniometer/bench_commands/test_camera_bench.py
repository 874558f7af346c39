"""The bench's commands where a camera is the detector."""

import cv2
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from goniometer.bench_commands.devices import devices
from goniometer.bench_commands.probe import HTTP, probe
from goniometer.bench_commands.read import read
from goniometer.errors import ConfigurationError, GoniometerError, SaturatedError

SIZE = {"width_px": 96, "height_px": 72}
CAMERA = {
    "type": "http_camera",
    **SIZE,
    "focal_px": 720,
    "distance_mm": 500,
    "acceptance_sr": 4.5e-4,
    "pixel_share": 5e-6,
    "joules_per_count": 3e-19,
}
SENSOR = {"read_counts": 4, "electrons_per_count": 0.5}


@pytest.fixture
def camera_bench(serve):
    """A bench that sees a white plate; its rig names the address that the simulated bench prints."""
    bench = serve(
        scene={
            "sample": {"material": "Fe", "sigma": 0.25, "rho_s": 0.0, "rho_d": 0.5, "rho_dd": 0},
            "lamp": {"power_w": 5e-5, "wavelength_nm": 550},
            "plate": {"size_mm": [100, 80]},
            "effects": [],
        },
        devices={"meter": CAMERA | {"sensor": SENSOR}},
        detector={
            "driver": "http_camera",
            "port": "simulated",
            **SIZE,
            "bits": 16,
            "region": {"left": 40, "top": 30, "width": 16, "height": 12},
            "watts_per_count_per_s": 3e-19,
            "sensor": SENSOR,
        },
    )
    assert yaml.safe_load(bench.rig.read_text())["devices"]["meter"]["port"].startswith("http://")
    return bench


def test_a_camera_is_asked_for_its_status_at_the_address_that_simulate_prints(camera_bench, told):
    found = devices((), camera_bench.rig, told.append)
    found.require_all()
    assert "http_camera (simulated HTTP camera, serial SC000001)" in str(found)


def test_a_server_without_status_is_told_from_one_that_is_a_camera(serve):
    class Server:
        def session(self):
            return self

        def receive(self, data, now_s):
            return [(now_s, b"HTTP/1.0 404 Not Found\r\nContent-Length: 3\r\n\r\nno\n")]

    bench = serve()
    assert str(probe(bench.sim.listen(Server(), "http"), (), HTTP)) == (
        "http_camera (a server of HTTP, HTTP/1.0 404 Not Found)"
    )


def test_a_video_is_not_taken_for_a_serial_port(camera_bench, told, tmp_path):
    def filmed(rig):
        camera = rig["devices"]["meter"]
        del camera["bits"]
        camera |= {"driver": "video_camera", "port": camera["port"] + "/stream.mjpg", "sample_s": 0.05}

    camera_bench.change_rig(filmed)
    found = devices((), camera_bench.rig, told.append, trace=tmp_path / "wire.log")
    assert "/stream.mjpg: not asked: it is opened by OpenCV" in str(found)
    assert [one.is_there for one in found.expected] == [True, True, None]
    assert "stream.mjpg" not in (tmp_path / "wire.log").read_text()
    with pytest.raises(GoniometerError, match="Not every device"):
        found.require_all()


def test_reading_shows_the_regions_counts_and_keeps_the_picture(camera_bench, told, tmp_path):
    reading = read(camera_bench.rig, 0.1, 1, 2, told.append, picture=tmp_path / "seen.png")
    counts = cv2.imread(str(tmp_path / "seen.png"), cv2.IMREAD_UNCHANGED)
    assert (counts.shape, counts.dtype) == ((72, 96), np.uint16)
    assert_allclose(reading.region.mean_counts, counts[30:42, 40:56].mean())
    assert_allclose(reading.readings_w[-1], reading.region.mean_counts * 3e-19 / 0.1)
    assert "counts   mean of the region's 192 pixels" in str(reading)


def test_a_saturated_picture_is_kept_to_be_looked_at(camera_bench, told, tmp_path):
    with pytest.raises(SaturatedError, match="192 of the region's 192 pixels have 65535 counts"):
        read(camera_bench.rig, 20.0, 1, 1, told.append, picture=tmp_path / "seen.png")
    assert cv2.imread(str(tmp_path / "seen.png"), cv2.IMREAD_UNCHANGED).max() == 65535


def test_a_picture_that_cannot_be_had(camera_bench, serve, told, tmp_path):
    with pytest.raises(GoniometerError, match=r"picture .*seen\.png cannot be written"):
        read(camera_bench.rig, 0.1, 1, 1, told.append, picture=tmp_path / "nowhere" / "seen.png")
    with pytest.raises(ConfigurationError, match="is no camera, and takes no picture"):
        read(serve().rig, 0.1, 1, 1, told.append, picture=tmp_path / "seen.png")
