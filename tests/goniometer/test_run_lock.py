"""One process writes a run; whoever looks is told, and harms nothing."""

import subprocess
import sys

import pytest

from goniometer.errors import JournalError
from goniometer.run_lock import is_being_written, sole_writer

HOLD = """
import sys
from pathlib import Path
from goniometer.run_lock import sole_writer
with sole_writer(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def other_process(tmp_path):
    """A process that writes the run in tmp_path, until it is ended."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_run_is_being_written_while_its_writer_lives(tmp_path, other_process):
    assert is_being_written(tmp_path)
    other_process.kill()
    other_process.wait()
    assert not is_being_written(tmp_path)


def test_a_second_writer_is_refused(tmp_path, other_process):
    with pytest.raises(JournalError, match="Another process is writing the run"), sole_writer(tmp_path):
        pytest.fail("two wrote one run")
    other_process.kill()
    other_process.wait()
    with sole_writer(tmp_path):
        assert is_being_written(tmp_path)
    assert not is_being_written(tmp_path)


def test_a_folder_that_was_never_written_is_not_being_written(tmp_path):
    assert not is_being_written(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_gone_is_named(tmp_path):
    with pytest.raises(JournalError, match="No device was moved"), sole_writer(tmp_path / "gone"):
        pass
