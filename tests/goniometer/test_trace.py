"""`--trace`: every byte, in a file that can be read whatever has ended the command."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

import goniometer
from drivers.clock import WallClock
from goniometer.bench import served_ports, simulate
from goniometer.cli import cli
from goniometer.errors import GoniometerError, NotConnectedError
from goniometer.load_files import load_scene
from goniometer.wire_trace import WIRE_LOG, wire_log
from sim_devices.newport_esp301.controller import NewportEsp301
from sim_devices.serving.control import ControlServer

ROOT = Path(__file__).resolve().parents[2]
LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z\t\d+\.\d{6}\t\S+\t[<>!]\t[^\t]*\t([0-9a-f]{2}( |$))*")
SHORT = {"exit": {"start_deg": 0.0, "stop_deg": 10.0, "step_deg": 10.0}, "readings": 1}
COMMANDS = {
    "devices": [],
    "home": ["--axis", "source_arm"],
    "move": ["source_arm", "3"],
    "read": [],
    "align": ["--axis", "detector_arm", "--from", "-5", "--to", "5"],
    "stop": [],
}


@pytest.fixture
def recipe(tmp_path):
    content = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text()) | SHORT
    for key in ("rig", "scene"):
        content[key] = str(ROOT / "recipes" / content[key])
    (tmp_path / "recipe.yaml").write_text(yaml.safe_dump(content))
    return tmp_path / "recipe.yaml"


@pytest.fixture
def served(tmp_path):
    """The rig file of a served bench that no other test's locks can meet."""
    loaded = load_scene(ROOT / "scenes" / "iron.yaml")
    with ExitStack() as stack:
        bench = stack.enter_context(simulate(loaded.scene, "max"))
        control = ControlServer(bench, loaded.scene_text)
        stack.callback(control.stop)
        document = yaml.safe_load(loaded.rig_text) | {"bench": control.address}
        for name, port in served_ports(loaded.rig, bench).items():
            document["devices"][name]["port"] = port
        (tmp_path / "bench.yaml").write_text(yaml.safe_dump(document))
        yield tmp_path / "bench.yaml"


def lines(log):
    text = log.read_text()
    assert text.endswith("\n")
    read = text.splitlines()
    assert [line for line in read if not LINE.fullmatch(line)] == []
    return [line.split("\t") for line in read]


def moved(log, device, direction):
    """All bytes that went to, or came from, a device."""
    return b"".join(bytes.fromhex(line[5]) for line in lines(log) if line[2:4] == [device, direction])


def test_a_run_has_every_byte_in_its_folder_and_reads_the_same(tmp_path, recipe, monkeypatch):
    heard, session_of = [], NewportEsp301.session

    def listened(controller):
        session = session_of(controller)
        receive = session.receive
        session.receive = lambda data, now_s: heard.append(data) or receive(data, now_s)
        return session

    monkeypatch.setattr(NewportEsp301, "session", listened)
    plain = goniometer.run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
    heard.clear()
    traced = goniometer.run(recipe, out=tmp_path / "runs", speed="max", live_fit=False, trace=True)
    assert not (plain.folder / WIRE_LOG).exists()
    assert traced.readings == plain.readings
    log = traced.folder / WIRE_LOG
    assert moved(log, "arms", ">") == b"".join(heard)
    assert moved(log, "arms", "<").count(b"ESP301 Version") == 1
    assert [line[2] for line in lines(log) if line[3] == "!"] == ["arms", "sample_stage", "analyzer", "meter"]
    assert float(lines(log)[-1][1]) == pytest.approx(traced.readings[-1].time_s, abs=2.0)


def test_a_device_that_is_not_there_leaves_the_log_and_otherwise_nothing(tmp_path, recipe):
    document = yaml.safe_load((ROOT / "rigs" / "simulated.yaml").read_text())
    for number, device in enumerate(document["devices"].values(), start=1):
        device["port"] = f"socket://127.0.0.1:{number}"
    rig, runs = tmp_path / "rig.yaml", tmp_path / "runs"
    rig.write_text(yaml.safe_dump(document))
    with pytest.raises(NotConnectedError):
        goniometer.run(recipe, rig_path=rig, out=runs)
    assert list(runs.iterdir()) == []
    with pytest.raises(NotConnectedError) as caught:
        goniometer.run(recipe, rig_path=rig, out=runs, trace=True)
    (log,) = runs.glob(f"*/{WIRE_LOG}")
    assert caught.value.__notes__ == [f"Every byte until then is in {log}"]
    ((*_, device, direction, text, _),) = lines(log)
    assert (device, direction) == ("arms", "!")
    assert text.startswith("port socket://127.0.0.1:1 cannot be opened")


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGKILL"])
def test_a_run_that_is_ended_leaves_a_log_of_whole_lines(tmp_path, recipe, name):
    command = [
        sys.executable,
        "-m",
        "goniometer",
        "run",
        recipe,
        "--out",
        tmp_path,
        "--speed",
        "10",
        "--trace",
        "--json",
    ]
    with subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        next(event for event in map(json.loads, process.stdout) if event["event"] == "ReadingStored")
        process.send_signal(getattr(signal, name))
        process.communicate()
    (log,) = tmp_path.glob(f"*/{WIRE_LOG}")
    assert moved(log, "arms", ">").count(b"1PA60") == 1
    assert (b"1ST\r" in moved(log, "arms", ">")) == (name == "SIGTERM")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_has_every_byte_in_the_working_directory(served, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    asked = [command, "--rig", str(served), *COMMANDS[command]]
    without = CliRunner().invoke(cli, asked)
    assert not (tmp_path / WIRE_LOG).exists()
    done = CliRunner().invoke(cli, [*asked, "--trace"])
    assert type(done.exception) is type(without.exception)  # a rough sample is no mirror to be aligned with
    assert "goes into wire.log" in done.stderr
    log = lines(tmp_path / WIRE_LOG)
    assert {line[3] for line in log} == {"!", ">", "<"}
    assert "is open" in log[0][4]


def test_a_second_command_continues_the_log(served, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        assert CliRunner().invoke(cli, ["home", "--rig", str(served), "--axis", "source_arm", "--trace"]).exit_code == 0
    assert moved(tmp_path / WIRE_LOG, "arms", ">").count(b"1OR") == 2


def test_a_log_that_cannot_be_written_is_refused_before_anything_is_opened(served, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / WIRE_LOG).mkdir()
    done = CliRunner().invoke(cli, ["move", "--rig", str(served), "source_arm", "3", "--trace"])
    assert isinstance(done.exception, GoniometerError)
    assert "The wire log wire.log cannot be written: Is a directory. No device was opened." in str(done.exception)


def test_without_a_path_there_is_no_log():
    with wire_log(None, None) as log:
        assert log is None


def test_a_log_is_closed_with_its_block(tmp_path):
    with wire_log(tmp_path / WIRE_LOG, WallClock()) as log:
        log.sent("arms", b"a")
    log.sent("arms", b"b")
    assert moved(tmp_path / WIRE_LOG, "arms", ">") == b"a"
