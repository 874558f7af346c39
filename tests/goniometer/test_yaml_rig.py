from __future__ import annotations

from pathlib import Path

import pytest

from goniometer.errors import ConfigurationError
from goniometer.load_files import load_rig
from goniometer.rig_file import Rig

ROOT = Path(__file__).parents[2]
EXAMPLE = (ROOT / "rigs" / "example_hardware.yaml").read_text(encoding="utf-8")


def load(tmp_path: Path, *changes: tuple[str, str]) -> Rig:
    text = EXAMPLE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "rig.yaml"
    path.write_text(text, encoding="utf-8")
    return load_rig(path)


def test_a_rig_knows_its_devices_by_role(tmp_path: Path) -> None:
    rig = load(tmp_path)
    assert not rig.is_simulated
    assert set(rig.axes()) == {"source_arm", "detector_arm", "sample_azimuth"}
    assert rig.axes()["detector_arm"].limits_deg == (-85, 85)
    assert rig.analyzer is rig.devices["analyzer"]
    assert rig.detector is rig.devices["meter"]
    assert rig.analyzer.slots == {1: "open", 2: 0, 3: 45, 4: 90, 5: 135, 6: "blocked"}


@pytest.mark.parametrize(
    "port", ["COM1", "COM256", "/dev/cu.usbserial-01", "/dev/pts/3", "socket://meter.lab:2000", "http://10.0.0.4:80"]
)
def test_ports_of_all_systems_are_accepted(tmp_path: Path, port: str) -> None:
    assert load(tmp_path, ("/dev/ttyUSB2", port)).analyzer.port == port


@pytest.mark.parametrize(
    "port",
    [
        "COM0",
        "COM",
        "ttyUSB0",
        "socket://host",
        "socket://:5",
        "socket://h:0",
        "socket://h:99999",
        "http://h",
        "http://h:80/still.png",
        "https://h:443",
    ],
)
def test_what_is_no_port_is_refused(tmp_path: Path, port: str) -> None:
    with pytest.raises(ConfigurationError, match=r"key 'devices.analyzer.port': got '.*'; allowed: a serial port"):
        load(tmp_path, ("/dev/ttyUSB2", port))


@pytest.mark.parametrize("address", ["socket://127.0.0.1:5000", "socket://localhost:1", "socket://[::1]:5000"])
def test_a_bench_served_on_this_computer_is_accepted(tmp_path: Path, address: str) -> None:
    assert load(tmp_path, ("calibration:", f"bench: {address}\ncalibration:")).bench == address


@pytest.mark.parametrize(
    "address", ["socket://10.0.0.1:5000", "socket://bench.lab:5000", "127.0.0.1:5000", "socket://127.0.0.1", "COM1"]
)
def test_a_bench_elsewhere_is_refused(tmp_path: Path, address: str) -> None:
    with pytest.raises(ConfigurationError, match=r"key 'bench': got .* allowed: an address on this computer"):
        load(tmp_path, ("calibration:", f"bench: {address}\ncalibration:"))


def test_a_simulated_device_and_a_bench_served_elsewhere_exclude_each_other(tmp_path: Path) -> None:
    changes = [(f"/dev/ttyUSB{number}", "simulated") for number in range(3)]
    changes += [("socket://192.168.0.20:2000", "simulated")]
    assert load(tmp_path, *changes).is_simulated
    with pytest.raises(
        ConfigurationError, match=r"but the bench at socket://127.0.0.1:5000 serves the devices"
    ) as caught:
        load(tmp_path, *changes, ("calibration:", "bench: socket://127.0.0.1:5000\ncalibration:"))
    assert len(caught.value.faults) == 4


def test_two_analyzers_are_one_too_many(tmp_path: Path) -> None:
    second = "  wheel: {driver: thorlabs_fw102c, port: COM9, slots: {}, slot_s: 1, settle_s: 0}\ncalibration:"
    with pytest.raises(ConfigurationError, match="slots': describes the slots none"):
        load(tmp_path, ("calibration:", second))
    second = second.replace("{}", "{1: 0, 2: 45, 3: 90, 4: 135, 5: open, 6: open}")
    with pytest.raises(ConfigurationError, match=r"'devices.wheel': is a second analyzer beside analyzer"):
        load(tmp_path, ("calibration:", second))


TABLE = """  table:
    driver: smc_lec
    port: /dev/ttyUSB1
    unit: 2
    baudrate: 115200
    axes:
      detector_arm: {limits_deg: [-85, 85], velocity_deg_s: 10, acceleration_deg_s2: 40, settle_s: 0, tolerance_deg: 1}
  sample_stage:"""


def two_drives(tmp_path: Path, *changes: tuple[str, str]) -> Rig:
    """The sample's drive, and the detector arm's of another make, on one adapter."""
    start = EXAMPLE.index("      detector_arm:")
    arm = EXAMPLE[start : EXAMPLE.index("  sample_stage:")]
    parity = ("    unit: 1                            # the drive's address switch", "    unit: 1\n    parity: none")
    return load(tmp_path, (arm, ""), ("  sample_stage:", TABLE), parity, *changes)


def test_drives_of_two_makes_may_share_a_port(tmp_path: Path) -> None:
    assert len(two_drives(tmp_path).devices) == 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("unit: 2", "unit: 1"), "has unit 1 on port '/dev/ttyUSB1', as table has; allowed: one each"),
        (("baudrate: 115200", "baudrate: 38400"), "one device a port, unless both have addresses on a line"),
        (("parity: none", "parity: even"), "one device a port, unless both have addresses on a line"),
    ],
)
def test_drives_that_cannot_share_a_port_are_refused(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        two_drives(tmp_path, change)


def test_elliptec_modules_of_two_kinds_may_share_a_port(tmp_path: Path) -> None:
    text = (ROOT / "rigs" / "simulated_slider.yaml").read_text(encoding="utf-8")
    start, end = text.index("  sample_stage:"), text.index("  analyzer:")
    rotator = """  sample_stage:
    driver: thorlabs_elliptec
    port: COM7
    address: "1"
    axes:
      sample_azimuth: {limits_deg: [-9, 9], velocity_deg_s: 430, acceleration_deg_s2: 99, settle_s: 0, tolerance_deg: 1}
"""
    text = text[:start] + rotator + text[end:].replace("simulated", "COM7", 1).replace("simulated", "COM8")
    path = tmp_path / "rig.yaml"
    path.write_text(text.replace("port: simulated", "port: COM9"), encoding="utf-8")
    assert load_rig(path).devices["analyzer"].port == load_rig(path).devices["sample_stage"].port == "COM7"
    path.write_text(path.read_text().replace('address: "1"', 'address: "0"'), encoding="utf-8")
    with pytest.raises(ConfigurationError, match="has address 0 on port 'COM7', as sample_stage has"):
        load_rig(path)
