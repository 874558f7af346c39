"""`goniometer simulate`: serve a bench for another process, and print the rig file that reaches it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TextIO

import yaml

from goniometer.bench import Speed, served_ports, simulate
from goniometer.errors import ScanInterrupted
from goniometer.load_files import load_scene
from goniometer.signals import Interruption
from sim_devices.bench import Bench
from sim_devices.serving.control import ControlServer

_LOOK_S = 0.2
"""How often a request to end is looked for."""


def serve(scene_path: Path, speed: Speed, out: TextIO) -> None:
    """Serve a scene until Ctrl-C or a signal; the rig file goes to `out`, everything else to standard error."""
    loaded = load_scene(scene_path)
    with Interruption() as interruption, simulate(loaded.scene, speed, folder=loaded.scene_path.parent) as bench:
        control = ControlServer(bench, loaded.scene_text)
        document = yaml.safe_load(loaded.rig_text)
        document["bench"] = control.address
        for name, port in served_ports(loaded.rig, bench).items():
            document["devices"][name]["port"] = port
        out.write(
            f"# {loaded.scene.scene}, served at speed {speed}\n{_terminals(bench)}{_how_to_fail(control.address)}"
        )
        out.write(yaml.safe_dump(document, sort_keys=False))
        out.flush()
        print("Serving until Ctrl-C.", file=sys.stderr)
        try:
            while True:
                interruption.wait(_LOOK_S)
                bench.raise_failure()
        except ScanInterrupted as asked:
            print(f"Ended by {asked.reason}.", file=sys.stderr)
        finally:
            control.stop()


def _terminals(bench: Bench) -> str:
    """Comment lines that name the pseudo-terminals which serve the same devices, where the system has them."""
    return "".join(f"# {name} also listens on {at.pty}\n" for name, at in bench.addresses.items() if at.pty)


def _how_to_fail(control_address: str) -> str:
    """A comment line with a command that lets something go wrong."""
    request = {"request": "fault", "fault": {"fault": "lamp_off", "for_s": 5}}
    port = control_address.rpartition(":")[2]
    return f"# let something go wrong: echo '{json.dumps(request)}' | nc -q 1 127.0.0.1 {port}\n"
