"""The fixture `goniometer_bench`, as other people's tests use it: found by itself, and leaving nothing behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "docs" / "examples"
SCENE = ROOT / "scenes" / "iron.yaml"
TWO_BENCHES = f"""
import pytest, serial

ADDRESSES = []

def ask(address, question):
    with serial.serial_for_url(address, timeout=5) as port:
        port.write(question)
        return port.readline()

def test_benches_are_apart(goniometer_bench):
    one, other = goniometer_bench({str(SCENE)!r}), goniometer_bench({str(SCENE)!r}, speed=100)
    ADDRESSES.extend(bench.addresses["arms"].tcp for bench in (one, other))
    ask(ADDRESSES[0], b"1DH7;1TP?\\r")
    assert ask(ADDRESSES[0], b"1TP?\\r") == b"7.000000\\r\\n"
    assert ask(ADDRESSES[1], b"1TP?\\r") == b"0.000000\\r\\n"
    assert one.clock.speed == "max" and other.clock.speed == 100

def test_which_fails(goniometer_bench):
    ADDRESSES.append(goniometer_bench({str(SCENE)!r}).addresses["meter"].tcp)
    assert not "as it should"

def test_they_are_gone():
    assert len(ADDRESSES) == 3
    for address in ADDRESSES:
        with pytest.raises(serial.SerialException, match="refused"):
            serial.serial_for_url(address)
"""


def pytest_in_a_process_of_its_own(folder, *arguments):
    """With no settings but the defaults, and warnings as errors."""
    (folder / "pytest.ini").write_text("[pytest]\nfilterwarnings = error\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", str(folder / "pytest.ini")]
    return subprocess.run(
        [*command, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )


def test_the_example_of_the_documentation_passes_as_printed(tmp_path):
    done = pytest_in_a_process_of_its_own(tmp_path, EXAMPLES / "test_my_driver.py")
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


def test_the_example_fails_where_the_instrument_software_is_wrong(tmp_path):
    text = (EXAMPLES / "test_my_driver.py").read_text()
    wrong = text.replace("1PA12.5", "1PA12.6").replace("Path(__file__).parents[2]", f"Path({str(ROOT)!r})")
    assert wrong.count("12.6") == 1
    (tmp_path / "test_my_driver.py").write_text(wrong)
    done = pytest_in_a_process_of_its_own(tmp_path, "test_my_driver.py")
    assert done.returncode == 1
    assert "assert 12.6 == 12.5" in done.stdout


def test_benches_are_apart_and_end_with_their_test_also_when_it_fails(tmp_path):
    (tmp_path / "test_two.py").write_text(TWO_BENCHES)
    done = pytest_in_a_process_of_its_own(tmp_path, "test_two.py")
    assert "1 failed, 2 passed" in done.stdout, done.stdout
    assert "FAILED test_two.py::test_which_fails" in done.stdout


def test_pytest_tells_what_the_fixture_is(tmp_path):
    done = pytest_in_a_process_of_its_own(tmp_path, "--fixtures")
    assert "goniometer_bench" in done.stdout
    assert "Start simulated benches that are stopped when the test ends." in done.stdout


@pytest.mark.parametrize("speed", ["fast", "10", 0, -1, float("nan"), float("inf"), None])
def test_a_speed_that_is_none_is_said(goniometer_bench, speed):
    with pytest.raises(ValueError, match=rf"got the speed {speed!r}; allowed: a number.* or 'max'"):
        goniometer_bench(SCENE, speed=speed)


def test_a_scene_that_cannot_be_used_is_said(goniometer_bench):
    with pytest.raises(ValueError, match=r"no_such_scene\.yaml"):
        goniometer_bench("no_such_scene.yaml")
