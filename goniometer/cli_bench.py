"""The commands for the bench itself: what answers, homing, moving, reading, aligning, stopping."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from goniometer.cli_options import FILE, POSITIVE, TRACE, Number
from goniometer.errors import GoniometerError

if TYPE_CHECKING:
    from goniometer.rig_devices.entry import Role

_RIG = click.option("--rig", type=FILE, required=True, help="The rig file of the bench.")
_AXIS = click.Choice(
    [
        *("source_arm", "detector_arm", "sample_azimuth", "detector_azimuth"),
        *("polarizer", "retarder", "generator_polarizer", "generator_retarder"),
    ]
)


@click.command()
@click.option("--port", "ports", multiple=True, metavar="PORT", help="Ask here only: COM3, /dev/ttyUSB0, socket://…")
@click.option("--rig", type=FILE, help="Check what a rig file expects, at its ports.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@TRACE
def devices(ports: tuple[str, ...], rig: Path | None, as_json: bool, trace: Path | None) -> None:
    """List serial ports and which known devices answer there. Moves nothing and changes no setting."""
    from goniometer.bench_commands.devices import devices as find_devices
    from goniometer.plain_json import plain

    found = find_devices(ports, rig, _note, trace=trace)
    click.echo(json.dumps(plain(found), indent=2) if as_json else found)
    found.require_all()


@click.command()
@_RIG
@click.option(
    "--axis", "roles", type=_AXIS, multiple=True, help="An axis to home; all, one by one, when none is given."
)
@click.option("--way-is-clear", is_flag=True, help="You have looked: the axis can touch nothing, wherever it goes.")
@TRACE
def home(rig: Path, roles: tuple[Role, ...], way_is_clear: bool, trace: Path | None) -> None:
    """Search each stage's zero, one axis after the other. Moves axes on ways that nobody knows beforehand."""
    from goniometer.bench_commands.home import home as home_axes

    home_axes(rig, roles, click.echo, _note, way_is_clear=way_is_clear, trace=trace)


@click.command(context_settings={"ignore_unknown_options": True})  # an angle below zero is no option
@_RIG
@click.argument("axis", type=_AXIS)
@click.argument("deg", type=Number())
@TRACE
def move(rig: Path, axis: Role, deg: float, trace: Path | None) -> None:
    """Move one axis to an angle in degrees, and say where it came to stand."""
    from goniometer.bench_commands.move import move as move_axis

    move_axis(rig, axis, deg, click.echo, _note, trace=trace)


@click.command()
@_RIG
@click.option("--exposure", "exposure_s", type=POSITIVE, help="Of one reading, in s; else 0.1.")
@click.option("--slot", type=int, help="Bring this slot of the analyzer into the beam first.")
@click.option("--count", type=click.IntRange(1, 100_000), default=5, show_default=True, help="How many readings.")
@click.option("--picture", type=FILE, metavar="FILE.png", help="Write a camera's last picture, saturated or not.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@TRACE
def read(
    rig: Path,
    exposure_s: float | None,
    slot: int | None,
    count: int,
    picture: Path | None,
    as_json: bool,
    trace: Path | None,
) -> None:
    """Read where every axis stands, the analyzer's slot, and the power at the detector. Moves no axis."""
    from goniometer.bench_commands.measuring import USUAL_EXPOSURE_S
    from goniometer.bench_commands.read import read as read_bench
    from goniometer.plain_json import plain

    reading = read_bench(rig, exposure_s or USUAL_EXPOSURE_S, slot, count, _note, picture=picture, trace=trace)
    click.echo(json.dumps(plain(reading), indent=2) if as_json else reading)


@click.command()
@_RIG
@click.option("--axis", type=click.Choice(["source_arm", "detector_arm"]), required=True, help="The arm to scan.")
@click.option("--from", "from_deg", type=Number(), required=True, help="Where the scan begins, in degrees.")
@click.option("--to", "to_deg", type=Number(), required=True, help="Where it ends.")
@click.option("--step", "step_deg", type=POSITIVE, help="Between points; else 40 steps.")
@click.option("--store", is_flag=True, help="Write the zero that was found into the rig file.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@TRACE
def align(
    rig: Path,
    axis: Literal["source_arm", "detector_arm"],
    from_deg: float,
    to_deg: float,
    step_deg: float | None,
    store: bool,
    as_json: bool,
    trace: Path | None,
) -> None:
    """Find an arm's true zero from the reflection of a mirror in the sample's place. Scans the arm."""
    from goniometer.bench_commands.align import advice
    from goniometer.bench_commands.align import align as align_arm
    from goniometer.plain_json import plain

    found = align_arm(rig, axis, from_deg, to_deg, step_deg, _note, store=store, trace=trace)
    click.echo(json.dumps(plain(found), indent=2) if as_json else f"{found}\n{advice(found, rig)}")


@click.command()
@_RIG
@TRACE
def stop(rig: Path, trace: Path | None) -> None:
    """Stop everything at once, also a scan that another process runs on the same ports."""
    from goniometer.bench_commands.stop import stop as stop_bench

    if not stop_bench(rig, click.echo, trace=trace):
        raise GoniometerError("Not everything was stopped: see above. Cut the power of what still moves.")


def _note(line: str) -> None:
    click.echo(line, err=True)
