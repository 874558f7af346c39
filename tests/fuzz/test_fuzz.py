"""Every parser survives mutated frames and long streams; ``python tests/fuzz`` shows what each one made of them."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent


@pytest.mark.parametrize(
    "count",
    [400, pytest.param(1_000_000, marks=[pytest.mark.long, pytest.mark.timeout(4 * 3600)])],
)
def test_parsers_survive(count):
    command = [sys.executable, "-W", "error", FOLDER, "--count", str(count), "--seed", "1"]
    fuzz = subprocess.run(command, check=False, capture_output=True, text=True)
    assert fuzz.returncode == 0, fuzz.stdout + fuzz.stderr
    assert fuzz.stdout.count(f"{count} strings") > 30
