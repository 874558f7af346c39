"""A port has one process at a time, and everybody can ask which."""

import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from goniometer.bench_commands.port_lock import held_ports, holder_of
from goniometer.bench_commands.port_name import _address
from goniometer.errors import ConfigurationError, GoniometerError, NotConnectedError

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


SPELLINGS = {
    "loopback": [
        "socket://localhost:4001",
        "socket://127.0.0.1:4001",
        "SOCKET://[::1]:4001",
        "socket://LocalHost:4001",
    ],
    "name": ["socket://server.lab:4001", "socket://Server.Lab:4001", "socket://10.0.0.7:4001"],
    "unknown": ["modbus-tcp://nobody.lab:502", "modbus-tcp://NOBODY.lab:502"],
}
ADDRESSES = {
    "localhost": ["::1", "127.0.0.1"],
    "127.0.0.1": ["127.0.0.1"],
    "::1": ["::1"],
    "server.lab": ["fd00::7", "10.0.0.9", "10.0.0.7"],
    "10.0.0.7": ["10.0.0.7"],
    "10.0.0.8": ["10.0.0.8"],
}


@pytest.fixture
def network(monkeypatch):
    """A network of a few computers."""

    def getaddrinfo(host, port):
        if host not in ADDRESSES:
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, 0)) for address in ADDRESSES[host]]

    monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
    _address.cache_clear()
    yield
    _address.cache_clear()


@pytest.mark.usefixtures("network")
@pytest.mark.parametrize("spellings", SPELLINGS.values(), ids=SPELLINGS)
def test_all_spellings_of_a_port_are_one(spellings):
    for spelt in spellings:
        with held_ports([spelt]):
            assert all(holder_of(other) for other in spellings)
            assert not holder_of("socket://10.0.0.8:4001")
            assert not holder_of(spelt.replace(":4001", ":4002").replace(":502", ":503"))


@pytest.mark.usefixtures("network")
def test_one_port_spelt_in_two_ways_is_refused():
    with (
        pytest.raises(
            ConfigurationError, match=r"names one port in two ways, socket://127\.0\.0\.1:1 and socket://local"
        ),
        held_ports(["socket://localhost:1", "socket://127.0.0.1:1"]),
    ):
        pass


def test_a_device_file_in_another_case_is_the_same():
    with held_ports(["/dev/ttyUSB7"]):
        assert holder_of("/dev/TTYusb7").pid == os.getpid()


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
