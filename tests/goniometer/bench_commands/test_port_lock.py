"""A port has one process at a time, and everybody can ask which."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from goniometer.bench_commands.port_lock import held_ports, holder_of
from goniometer.errors import GoniometerError, NotConnectedError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a COM port opens for one process only")

PORT = "socket://192.168.0.20:4001"
HOLD = """
import sys, time
from goniometer.bench_commands.port_lock import held_ports
with held_ports(sys.argv[1:]):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holding():
    """Hold ports in another process until the test ends."""
    processes = []

    def hold(*ports):
        process = subprocess.Popen([sys.executable, "-c", HOLD, *ports], stdout=subprocess.PIPE, text=True)
        processes.append(process)
        assert process.stdout.readline() == "held\n"
        return process

    yield hold
    for process in processes:
        process.kill()
        process.wait()
        process.stdout.close()


def folder():
    return Path(tempfile.gettempdir()) / f"goniometer-{os.getuid()}"


def test_a_port_is_held_while_the_block_lasts():
    assert holder_of(PORT) is None
    with held_ports([PORT, "COM3"]):
        assert holder_of(PORT).pid == holder_of("COM3").pid == os.getpid()
        assert holder_of("COM4") is None
    assert holder_of(PORT) is None


def test_a_port_that_another_process_holds_is_refused_and_none_is_held(holding):
    process = holding(PORT)
    with pytest.raises(NotConnectedError, match=rf"held by process {process.pid} \(-c"), held_ports(["COM3", PORT]):
        pass
    assert holder_of("COM3") is None
    assert holder_of(PORT).pid == process.pid


def test_a_process_that_was_killed_holds_nothing(holding):
    process = holding(PORT)
    process.kill()
    process.wait()
    assert holder_of(PORT) is None
    with held_ports([PORT]):
        assert holder_of(PORT).pid == os.getpid()


def test_both_names_of_a_device_file_are_one_port(tmp_path, monkeypatch):
    assert Path("/dev/stdin").is_symlink()
    with held_ports(["/dev/stdin"]):
        assert holder_of(os.path.realpath("/dev/stdin")).pid == os.getpid()


def test_the_folder_is_the_users_own():
    with held_ports([PORT]):
        assert folder().stat().st_mode & 0o777 == 0o700
        assert [file.stat().st_mode & 0o777 for file in folder().iterdir()] == [0o600]


def test_a_folder_that_others_may_use_is_refused():
    folder().mkdir(mode=0o755)
    with pytest.raises(GoniometerError, match="others may use it"), held_ports([PORT]):
        pass


def test_a_link_in_the_place_of_the_folder_is_not_followed(tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    folder().symlink_to(tmp_path / "elsewhere")
    with pytest.raises(GoniometerError, match="is no folder of its own"), held_ports([PORT]):
        pass
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_link_in_the_place_of_a_lock_is_not_followed(tmp_path):
    with held_ports([PORT]):
        (lock,) = folder().iterdir()
    lock.unlink()
    (tmp_path / "precious").write_text("text")
    lock.symlink_to(tmp_path / "precious")
    assert holder_of(PORT) is None
    with pytest.raises(GoniometerError, match="cannot be opened"), held_ports([PORT]):
        pass
    assert (tmp_path / "precious").read_text() == "text"
