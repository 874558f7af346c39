"""The command that calibrates the analyzer."""

from __future__ import annotations

import json
from pathlib import Path

import click

from goniometer.cli_options import FILE, Speed, SpeedType


@click.command()
@click.argument("paths", type=FILE, metavar="RECIPE|RUN...", nargs=-1, required=True)
@click.option("--rig", type=FILE, help="A rig file in place of the recipe's.")
@click.option("--out", type=FILE, default=Path("runs"), show_default=True, help="Where the runs' folders are made.")
@click.option("--speed", type=SpeedType(), help="Time scale of the simulated bench, 0.1 to 1000; max: virtual time.")
@click.option("--store", type=FILE, help="Write the calibration into this YAML file, for recipes to name.")
@click.option("--json", "as_json", is_flag=True, help="Print the calibration as JSON.")
def calibrate(
    paths: tuple[Path, ...], rig: Path | None, out: Path, speed: Speed | None, store: Path | None, as_json: bool
) -> None:
    """Find each polarizer's angle, extinction and transmission from a known polarizer or a plate of known index.

    A RECIPE with a section calibrate is measured; a RUN is a scan of such a recipe made before. All are solved as one.
    """
    from goniometer.calibrating.command import calibrate as calibrate_analyzer
    from goniometer.calibrating.command import summary

    found = calibrate_analyzer(paths, rig_path=rig, out=out, speed=speed, store=store, ask=_ask, tell=_note)
    click.echo(json.dumps(found.model_dump(mode="json"), indent=2) if as_json else summary(found))
    if store is None:
        _note("Nothing was stored: name a file with --store for recipes to use it.")
    else:
        _note(f"wrote {store}. Take the reference out of the light before you measure.")


def _ask(what: str) -> None:
    click.prompt(f"{what}, then press Enter", default="", show_default=False, prompt_suffix=" ", err=True)


def _note(line: str) -> None:
    click.echo(line, err=True)
