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


@pytest.mark.parametrize("port", ["COM1", "COM256", "/dev/cu.usbserial-01", "/dev/pts/3", "socket://meter.lab:2000"])
def test_ports_of_all_systems_are_accepted(tmp_path: Path, port: str) -> None:
    assert load(tmp_path, ("/dev/ttyUSB2", port)).analyzer.port == port


@pytest.mark.parametrize(
    "port",
    ["COM0", "COM", "ttyUSB0", "socket://host", "socket://:5", "socket://h:0", "socket://h:99999", "http://h:80"],
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
