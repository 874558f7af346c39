"""`goniometer devices`: what is there, what a rig file misses, and which ports could not be asked."""

import errno
import json
import os
import subprocess
import sys
from dataclasses import replace
from typing import ClassVar

import pytest
import serial

from goniometer.bench_commands.devices import devices
from goniometer.bench_commands.port_lock import held_ports
from goniometer.bench_commands.probe import APT_USB, SERIAL, SOCKET, expected_rounds, probe, rounds_for
from goniometer.errors import GoniometerError
from goniometer.rig_devices.entry import Greeting
from goniometer.rig_devices.thorlabs_pm100 import ThorlabsPm100Entry


def test_a_port_without_a_device_is_told_from_one_that_does_not_open(serve):
    class Silent:
        def session(self):
            return self

        def receive(self, data, now_s):
            return []

    bench = serve()
    port = bench.sim.listen(Silent())
    impatient = [replace(SOCKET[0], questions=[replace(SOCKET[0].questions[0], reply_s=0.1)])]
    assert str(probe(port, (), impatient)) == "no known device answers"
    assert str(probe("socket://127.0.0.1:1", (), SOCKET)).startswith("cannot be opened: [Errno 111]")


def test_a_rig_file_is_checked_against_what_answers(serve, told):
    bench = serve()
    found = devices((), bench.rig, told.append)
    found.require_all()
    assert len(found.ports) == len(found.expected) == 3
    addresses = {name: at.tcp for name, at in bench.sim.addresses.items()}

    def exchanged(rig):
        rig["devices"]["analyzer"]["port"] = addresses["meter"]
        rig["devices"]["meter"]["port"] = addresses["analyzer"]

    bench.change_rig(exchanged)
    found = devices((), bench.rig, told.append)
    with pytest.raises(GoniometerError, match="Not every device of the rig file was found"):
        found.require_all()
    assert {one.device: one.is_there for one in found.expected} == {"arms": True, "analyzer": False, "meter": False}
    assert "thorlabs_fw102c (THORLABS FW102C" in str(found)
    assert "meter (thorlabs_pm100 on" in str(found)


def test_only_the_ports_that_were_named_are_asked(serve, told):
    bench = serve()
    port = bench.sim.addresses["meter"].tcp
    found = devices((port,), None, told.append)
    assert [(one.port, one.probed.answers[0].driver) for one in found.ports] == [(port, "thorlabs_pm100")]
    assert told == [f"asking at {port}"]
    found.require_all()


def test_a_port_that_was_named_must_open(serve, told):
    bench = serve()
    meter, nobody = bench.sim.addresses["meter"].tcp, "socket://127.0.0.1:1"
    with pytest.raises(GoniometerError, match="Not every port could be asked"):
        devices((meter, nobody), None, told.append).require_all()


class GreetedMeter(ThorlabsPm100Entry):
    """A device of another package, which says how it is asked."""

    greeting: ClassVar[Greeting | None] = Greeting(b"SYST:SENS:IDN?\n", b"S120C", baudrate=9600)


class SilentMeter(ThorlabsPm100Entry):
    """One that does not."""

    driver: str


def test_a_device_of_another_package_is_asked_its_own_question(serve):
    bench = serve()
    port = bench.sim.addresses["meter"].tcp
    keys = {"port": port, "sample_s": 0.003, "noise": {"read_w": 2e-11, "shot": True}}
    greeted = GreetedMeter(driver="thorlabs_pm100", **keys)
    (asked,) = expected_rounds(port, greeted)
    assert (asked.baudrate, asked.parity, asked.rtscts) == (9600, "N", False)
    (answer,) = probe(port, (asked,), ()).answers
    assert (answer.driver, answer.says[:6]) == ("thorlabs_pm100", "S120C,")
    assert expected_rounds(port, SilentMeter(driver="something", **keys)) == ()


@pytest.mark.skipif(sys.platform == "win32", reason="a COM port opens for one process only")
def test_a_port_that_is_held_is_named_and_not_asked(serve, told):
    bench = serve()
    port = bench.sim.addresses["arms"].tcp
    with held_ports([port]):
        found = devices((), bench.rig, told.append)
    (held,) = [one for one in found.ports if one.port == port]
    assert f"held by process {os.getpid()}" in str(held)
    assert held.probed.answers == ()
    assert {one.device: one.is_there for one in found.expected} == {"arms": None, "analyzer": True, "meter": True}
    with pytest.raises(GoniometerError, match="Not every device of the rig file was found"):
        found.require_all()


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo-terminal")
def test_a_serial_port_that_another_program_holds_is_named_so(serve):
    bench = serve()
    port = bench.sim.addresses["meter"].pty
    with serial.Serial(port, exclusive=True):
        assert str(probe(port, (), SERIAL)) == "held by another program; nothing was asked"
    assert probe(port, (), SERIAL).answers[0].driver == "thorlabs_pm100"


def test_a_port_that_is_busy_or_forbidden_is_told_apart(monkeypatch):
    def opens(error):
        def serial_for_url(*arguments, **options):
            raise error

        monkeypatch.setattr(serial, "serial_for_url", serial_for_url)
        return str(probe("/dev/ttyUSB9", (), SERIAL))

    assert opens(serial.SerialException(errno.EBUSY, "busy")).startswith("held by another program")
    assert opens(
        serial.SerialException("could not open port 'COM3': PermissionError(13, 'Access is denied.')")
    ).startswith("held by another program")
    assert opens(serial.SerialException(errno.EACCES, "Permission denied")).startswith("cannot be opened")


def test_a_serial_adapter_of_apt_is_asked_as_nothing_else():
    assert rounds_for("/dev/ttyUSB0", (0x0403, 0xFAF0)) == APT_USB
    assert rounds_for("/dev/ttyUSB0", (0x0403, 0x6001)) == SERIAL
    apt = {question.data for one in APT_USB for question in one.questions}
    assert not apt & {question.data for one in SERIAL for question in one.questions}


def test_the_command_line_prints_json_and_fails_when_a_device_is_missing(serve):
    bench = serve()
    bench.change_rig(lambda rig: rig["devices"]["meter"].update(port="socket://127.0.0.1:1"))
    command = [sys.executable, "-m", "goniometer", "devices", "--rig", str(bench.rig), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    said = json.loads(done.stdout)
    assert [one["device"] for one in said["expected"] if not one["is_there"]] == ["meter"]
    drivers = {answer["driver"] for port in said["ports"] for answer in port["probed"]["answers"]}
    assert drivers == {"newport_esp301", "thorlabs_fw102c"}
    assert "Not every device of the rig file was found" in done.stderr
