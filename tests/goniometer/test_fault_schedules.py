"""Whatever goes wrong during a scan, it ends with the right data or with an error that says what failed."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCHEDULES = ROOT / "benchmarks" / "fault_schedules.py"
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="the time limit of a run is an alarm of POSIX")


def ended(runs, first):
    """Run schedules; their table is shown, and it is a failure when one of them was violated."""
    command = [sys.executable, str(SCHEDULES), str(runs), "--first", str(first)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{runs} runs, 0 with violations" in done.stdout
    return done.stdout


@posix_only
def test_three_hundred_fault_schedules_end_well():
    shown = ended(300, first=0)
    assert " same data" in shown, "faults that a driver gets over"
    assert " DeviceFaultError" in shown, "and some that it does not"


@posix_only
@pytest.mark.long
@pytest.mark.timeout(3600)
def test_ten_thousand_fault_schedules_end_well():
    ended(10_000, first=100_000)
