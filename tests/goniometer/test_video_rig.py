"""Video and GenICam cameras in a rig file."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import get_args

import cv2
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from acquisition.protocols import Camera
from drivers.camera.capture import SETTINGS
from drivers.camera.frame import Frame
from drivers.clock import WallClock
from goniometer.errors import ConfigurationError, NotConnectedError, SaturatedError
from goniometer.load_files import load_rig
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.video_camera import VideoCameraEntry

EXAMPLE = Path(__file__).parents[2] / "rigs" / "example_hardware.yaml"
CAMERA = {
    "width_px": 64,
    "height_px": 48,
    "region": {"left": 8, "top": 4, "width": 16, "height": 12},
    "watts_per_count_per_s": 1e-12,
    "sensor": {"read_counts": 300, "electrons_per_count": 0.2},
}
VIDEO = {"driver": "video_camera", "port": "0", "sample_s": 0.1} | CAMERA
GENICAM = {
    "driver": "genicam_camera",
    "port": "M-0815",
    "transport_library": "/opt/maker/maker.cti",
    "bits": 12,
} | CAMERA


@pytest.fixture
def load(tmp_path):
    def rig(camera, **changes):
        file = yaml.safe_load(EXAMPLE.read_text(encoding="utf-8"))
        file["devices"]["meter"] = camera | changes
        path = tmp_path / "rig.yaml"
        path.write_text(yaml.safe_dump(file), encoding="utf-8")
        return load_rig(path)

    return rig


@pytest.mark.parametrize(
    "port",
    [
        *("0", "12", "/dev/video0", "/dev/v4l/by-id/usb-Cam_1-video-index0", "clip.avi", "../films/a b.mkv"),
        *(
            r"C:\films\a.avi",
            "http://10.0.0.5/stream.mjpg?fps=10",
            "https://cam.lab/s",
            "rtsp://me:secret@cam:554/live",
        ),
    ],
)
def test_what_a_video_may_come_from(load, port):
    assert load(VIDEO, port=port).detector.port == port


@pytest.mark.parametrize("port", ["", "COM3", "socket://h:1", "modbus-tcp://h:502", "http://", "ftp://h/a.avi"])
def test_what_is_no_video(load, port):
    with pytest.raises(
        ConfigurationError, match=r"devices\.meter\.port': got '.*'; allowed: a camera's number in quotes"
    ):
        load(VIDEO, port=port)


def test_a_simulated_video_has_an_address(load):
    with pytest.raises(
        ConfigurationError, match="got 'simulated'; allowed: the http:// address of the simulated camera"
    ):
        load(VIDEO, port="simulated")


def test_only_a_camera_has_settings(load):
    assert load(VIDEO, settings={"exposure": 157, "frames_per_s": 10}).detector.settings["exposure"] == 157
    with pytest.raises(ConfigurationError, match="settings': names gain, but only a camera has settings"):
        load(VIDEO, port="a.avi", settings={"gain": 3})


def test_settings_are_those_that_the_driver_knows():
    (names, _) = get_args(VideoCameraEntry.model_fields["settings"].annotation)
    assert {"frame_width", "frame_height", *get_args(names)} == set(SETTINGS)


def test_noise_averages_down_with_the_pictures(load):
    model = load(VIDEO).detector.noise_model(550.0)
    exposures_s = np.array([0.1, 0.4])
    dark_w2 = (300 * 1e-12 / 0.1) ** 2 / 192
    light_w2 = dark_w2 + 1e-9 / 0.1 * (1e-12 / 0.2) / 192
    assert_allclose(model.variance(np.array([0.0, 0.0]), exposures_s), [dark_w2, dark_w2 / 4])
    assert_allclose(model.variance(np.array([1e-9, 1e-9]), exposures_s), [light_w2, light_w2 / 4])


def test_a_reading_may_wait_for_the_next_picture(load):
    timing = load(VIDEO, readout_s=0.05).detector.timing
    assert 0.4 + 0.1 + 0.05 < timing.reading_s(0.4) < 0.4 + 0.1 + 0.05 + 0.02


def connected(rig, stack):
    bench = Connecting({"meter": rig.detector.port}, WallClock(), 550.0, stack)
    rig.detector.connect("meter", bench)
    return bench


def test_video_file_as_the_detector_of_a_rig(load, tmp_path):
    picture = np.random.default_rng(1).integers(0, 200, (48, 64), np.uint8)
    path = str(tmp_path / "a.avi")
    writer = cv2.VideoWriter(path, cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*"FFV1"), 10.0, (64, 48), False)
    for _ in range(3):
        writer.write(picture)
    writer.release()
    with ExitStack() as stack:
        bench = connected(load(VIDEO, port=path), stack)
        camera = bench.detectors["meter"]
        assert isinstance(camera, Camera)
        assert bench.identities == {"meter": f"{path}, 64 x 48"}
        camera.start_reading(0.3)
        give_up_s = bench.clock.now() + 10
        while camera.is_reading():
            assert bench.clock.now() < give_up_s
        assert camera.power_w() == pytest.approx(picture[4:16, 8:24].mean() * 257 / 0.1 * 1e-12)


def test_genicam_camera_whose_maker_is_not_installed(load):
    rig = load(GENICAM)
    assert rig.detector.saturated_from == 4095
    with (
        ExitStack() as stack,
        pytest.raises(NotConnectedError, match=r"meter: there is no transport library /opt/maker"),
    ):
        connected(rig, stack)


def test_no_genicam_camera_is_simulated(load):
    with pytest.raises(ConfigurationError, match="got 'simulated', but there is no simulated GenICam camera"):
        load(GENICAM, port="simulated")


def test_too_bright_a_video_is_not_cured_by_shorter_readings(load):
    """They are means of as bright pictures."""
    bright = Frame(np.full((48, 64), 65535, np.uint16), 16, 0.04, 0.0, 0.0, 0)
    with pytest.raises(SaturatedError, match="have the camera expose each picture for less"):
        load(VIDEO).detector.photometer("camera").power_w(bright)
