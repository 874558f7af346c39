"""Cameras in a rig file."""

from __future__ import annotations

import re
import sys
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from drivers.clock import WallClock
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_rig
from goniometer.planning import noise
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.http_camera import HttpCameraEntry

RIG = Path(__file__).parents[2] / "rigs" / "simulated.yaml"
CAMERA = {
    "driver": "http_camera",
    "port": "http://192.168.0.20:80",
    "width_px": 640,
    "height_px": 480,
    "bits": 12,
    "region": {"left": 600, "top": 10, "width": 40, "height": 20},
    "watts_per_count_per_s": 2e-12,
    "sensor": {"read_counts": 3.0, "electrons_per_count": 2.5, "linearity": [[0, 0], [2000, 2000.0], [4095, 4200]]},
    "optics": {"focal_px": 3000, "centre_px": [319.5, 239.5]},
    "readout_s": 0.03,
}


def camera(**changes):
    return HttpCameraEntry.model_validate(CAMERA | changes)


def test_a_rig_with_a_camera_as_its_detector(tmp_path):
    rig = yaml.safe_load(RIG.read_text())
    del rig["devices"]["meter"]
    for name in ("arms", "sample_stage", "analyzer"):
        rig["devices"][name]["port"] = f"/dev/{name}"
    rig["devices"]["camera"] = CAMERA
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    loaded = load_rig(tmp_path / "rig.yaml")
    assert loaded.detector == camera()
    assert loaded.detector.sensor.linearity[2] == (4095.0, 4200.0)
    variance = 4e-24 * 9 / (0.1**2 * 800) + 2e-12 * 1e-9 / (2.5 * 0.1 * 800)
    stated = noise(loaded, 550.0).variance(np.array([1e-9]), np.array([0.1]))
    np.testing.assert_allclose(stated, variance, rtol=1e-12)


def test_a_gain_that_no_address_tells_the_camera_is_refused():
    untold = {"still": "/snap?exposure_s={exposure_s}", "sensor": {"read_counts": 3.0, "electrons_per_count": 2.5}}
    assert camera(**untold).gain_db == 0.0
    with pytest.raises(
        ValidationError, match=r"does not tell the camera gain_db, 6; allowed: a path with {gain_db} in"
    ):
        camera(**untold, gain_db=6.0)
    told = untold | {"still": "/snap?exposure_s={exposure_s}&gain={gain_db}"}
    assert camera(**told, gain_db=6.0).gain_db == 6.0


def test_what_follows_from_the_keys():
    entry = camera(most_saturated=0.01)
    assert (entry.saturated_from, camera(saturation_counts=3900).saturated_from) == (4095, 3900)
    assert entry.optics.optics.focal_px == 3000
    assert 1.03 < entry.timing.reading_s(1.0) < 1.1
    assert entry.most_samples * entry.sample_s == pytest.approx(3600)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"region": {"left": 601, "top": 470, "width": 40, "height": 11}},
            "reaches column 640 and row 480; allowed: at",
        ),
        ({"saturation_counts": 4096}, "got 4096; allowed: at most 4095, the most that 12 bits hold"),
        ({"bits": 7}, "bits"),
        ({"warm_up_frames": 0}, "warm_up_frames"),
        ({"most_saturated": 1.0}, "most_saturated"),
        ({"noise": {"read_w": 1e-9, "shot": True}}, "noise"),
        (
            {"sensor": CAMERA["sensor"] | {"linearity": [[0, 0], [10, 12], [10, 13]]}},
            "got [10, 13] behind [10, 12]; all",
        ),
        ({"sensor": CAMERA["sensor"] | {"linearity": [[0, 0]]}}, "has 1 pairs; allowed: two or more"),
        (
            {"sensor": CAMERA["sensor"] | {"linearity": [[0, 0], [5000, 5000]]}},
            "reaches 5000 counts; allowed: at most 4095",
        ),
        (
            {"sensor": CAMERA["sensor"] | {"linearity": [[0, 0], [2000, 2050]]}},
            "ends at 2000 counts; allowed: up to saturation at 4095",
        ),
        ({"sensor": CAMERA["sensor"] | {"linearity": [[10, 10], [4095, 4200]]}}, "begins at 10 counts; allowed: 0"),
        ({"gain_db": 12}, "holds at gain 0 dB, and gain_db is 12; allowed: gain_db 0, or no table"),
        ({"port": "COM3"}, "got 'COM3'; allowed: the camera's address such as http://"),
        ({"still": "still.png?exposure_s={exposure_s}"}, "allowed: a path that begins with / and has {exposure_s}"),
        ({"still": "/still.png?gain_db={gain_db}"}, "allowed: a path that begins with / and has {exposure_s} in it"),
        ({"still": "/still.png?exposure_s={exposure_s}&iso={iso}"}, "allowed: a path that begins"),
        ({"still": "/a still?exposure_s={exposure_s}"}, "allowed: a path that begins"),
        ({"still": "/still?exposure_s={exposure_s}{"}, "allowed: a path that begins"),
    ],
)
def test_what_cannot_be_is_refused(changes, message):
    with pytest.raises(ValidationError, match=re.escape(message)):
        camera(**changes)


@pytest.mark.parametrize("module", ["h11", "cv2"])
def test_without_its_packages_no_port_is_opened_and_a_person_is_told_what_to_install(monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    bench = Connecting({}, WallClock(), None, ExitStack())
    with pytest.raises(ConfigurationError, match=rf"{module} is not installed. .* pip install 'goniometer\[camera\]'"):
        camera().connect("camera", bench)
