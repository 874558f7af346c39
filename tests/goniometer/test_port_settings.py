"""Each driver opens its serial port as the device's manual says, or as the rig file does."""

from __future__ import annotations

from contextlib import ExitStack

import pytest
import serial
from pydantic import TypeAdapter

from drivers.clock import WallClock
from goniometer.errors import NotConnectedError
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.known import AnyDevice

AXIS = {"limits_deg": [-5, 90], "velocity_deg_s": 20, "acceleration_deg_s2": 80, "settle_s": 0, "tolerance_deg": 0.1}
NOISE = {"read_w": 2e-11, "shot": True}
WHEEL = {1: "open", 2: 0, 3: 45, 4: 90, 5: 135, 6: "blocked"}
LOCK_IN = {"time_constant_s": 0.1, "sample_s": 1, "responsivity_v_per_w": 1e5, "noise": NOISE}
DEVICES = {
    "newport_esp301": {"axes": {"source_arm": AXIS | {"axis": 1}}},
    "thorlabs_apt": {"stage": "K10CR1", "axes": {"source_arm": AXIS}},
    "thorlabs_elliptec": {"axes": {"source_arm": AXIS | {"velocity_deg_s": 430}}},
    "oriental_az": {"unit": 1, "axes": {"source_arm": AXIS | {"steps_per_deg": 50}}},
    "smc_lec": {"unit": 1, "axes": {"source_arm": AXIS}},
    "thorlabs_fw102c": {"slots": WHEEL, "slot_s": 0.5, "settle_s": 0},
    "thorlabs_pm100": {"sample_s": 0.003, "noise": NOISE},
    "stanford_sr830": LOCK_IN,
}
# rate, parity and RTS/CTS as delivered, and with these keys
USUAL = [
    ("newport_esp301", {}, (19200, "N", True)),
    ("newport_esp301", {"baudrate": 921600}, (921600, "N", True)),
    ("thorlabs_apt", {}, (115200, "N", True)),
    ("thorlabs_elliptec", {}, (9600, "N", False)),
    ("oriental_az", {}, (115200, "E", False)),
    ("oriental_az", {"baudrate": 9600, "parity": "none"}, (9600, "N", False)),
    ("smc_lec", {}, (38400, "N", False)),
    ("smc_lec", {"baudrate": 57600}, (57600, "N", False)),
    ("thorlabs_fw102c", {}, (115200, "N", False)),
    ("thorlabs_fw102c", {"baudrate": 9600}, (9600, "N", False)),
    ("thorlabs_pm100", {}, (115200, "N", False)),
    ("thorlabs_pm100", {"baudrate": 9600}, (9600, "N", False)),
    ("stanford_sr830", {}, (9600, "N", False)),
    ("stanford_sr830", {"baudrate": 19200}, (19200, "N", False)),
]


@pytest.mark.parametrize(("driver", "keys", "expected"), USUAL)
def test_serial_port_is_opened_as_the_manual_or_the_rig_file_says(monkeypatch, driver, keys, expected):
    opened = []

    def serial_for_url(port, **settings):
        opened.append((settings["baudrate"], settings["parity"], settings["rtscts"]))
        raise serial.SerialException("enough was seen")

    monkeypatch.setattr(serial, "serial_for_url", serial_for_url)
    entry = {"driver": driver, "port": "/dev/ttyUSB7"} | DEVICES[driver] | keys
    device = TypeAdapter(AnyDevice).validate_python(entry)
    with ExitStack() as open_devices, pytest.raises(NotConnectedError, match="enough was seen"):
        device.connect("device", Connecting({"device": device.port}, WallClock(), None, open_devices))
    assert opened == [expected]
