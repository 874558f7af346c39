"""Whatever goes wrong during a scan, on a bench of any make, it ends with the right data or says what failed."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCHEDULES = ROOT / "benchmarks" / "fault_schedules"
BENCHES = {
    "wheel",
    "wheel, terminals",
    "slider",
    "USB stages",
    "lock-in",
    "drives, RTU",
    "drives, gateway",
    "Elliptec bus",
    "camera",
}
FAMILIES = {
    "newport_esp301",
    "oriental_az",
    "smc_lec",
    "apt",
    "elliptec",
    "elliptec_slider",
    "fw102c",
    "pm100",
    "sr830",
    "http_camera",
}
FAULTS = 33
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="the time limit of a run is an alarm of POSIX")


def ended(runs, first):
    """Run schedules; their tables are shown, and it is a failure when one of them was violated."""
    command = [sys.executable, str(SCHEDULES), str(runs), "--first", str(first)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{runs} runs, 0 with violations" in done.stdout
    return done.stdout


def table(shown, title):
    """One of the tables: its columns, and its counts by row."""
    (found,) = re.findall(rf"^{title} .*?(?=^$)", shown, re.MULTILINE | re.DOTALL)
    head, *lines = (re.split(r"\s{2,}", line) for line in found.strip().splitlines())
    return set(head[1:]), {name: [int(cell) for cell in cells if cell != "-"] for name, *cells in lines}


@posix_only
def test_three_hundred_fault_schedules_end_well():
    shown = ended(300, first=2100)  # from where on faults that only a camera has strike, too
    endings, benches = table(shown, "bench")
    assert set(benches) == BENCHES | {"all"}
    assert {"same data", "DeviceFaultError"} <= endings, "faults that a driver gets over, and some that it does not"
    families, struck = table(shown, "struck")
    assert families == FAMILIES
    assert len(struck) == FAULTS
    assert all(map(any, struck.values())), "every fault has struck something"


@posix_only
@pytest.mark.long
@pytest.mark.timeout(3600)
def test_ten_thousand_fault_schedules_end_well():
    assert "never struck: none" in ended(10_000, first=100_000)
