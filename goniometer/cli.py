"""The command line.

Exit codes: 0 done; 1 a device, the data or the disk failed; 2 a recipe, rig, scene or the command line cannot be used;
3 a scan was ended by the key q or `ScanControl.abort`; 130, 143, 129 it was ended by Ctrl-C, SIGTERM, SIGHUP. Whatever
of these the code, the bench has been stopped and the readings that were shown are stored. 4 the program hung: the
readings are stored, and another process stops the bench.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Literal

import click

from goniometer import __version__
from goniometer.cli_bench import align, devices, home, move, read, stop
from goniometer.cli_calibrate import calibrate
from goniometer.cli_fits import budget, compare, fit
from goniometer.cli_options import FILE, Speed, SpeedType, mode_of, tell_results
from goniometer.cli_runs import export, resume, runs
from goniometer.errors import ConfigurationError, GoniometerError, ScanInterrupted
from goniometer.wire_trace import WIRE_LOG


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="goniometer")
def cli() -> None:
    """Run a polarimetric goniometer from a YAML recipe and fit the material while it scans."""


@cli.command()
@click.argument("file", type=FILE)
@click.option("--rig", type=FILE, help="A rig file in place of the recipe's.")
@click.option("--show", is_flag=True, help="Print a recipe with all that it includes instead, as a run keeps it.")
def check(file: Path, rig: Path | None, show: bool) -> None:
    """Check a recipe with its rig and scene, and print its steps and their duration. Moves nothing.

    A rig or a scene can be checked alone.
    """
    from goniometer.check import describe_plan
    from goniometer.load_files import Setup, load_file, load_recipe

    loaded = load_recipe(file, rig) if rig or show else load_file(file)
    if show and isinstance(loaded, Setup):
        click.echo(loaded.recipe_text.rstrip("\n"))
        return
    click.echo(describe_plan(loaded) if isinstance(loaded, Setup) else f"{file} is valid.")


@cli.command()
@click.argument("recipe", type=FILE)
@click.option("--rig", type=FILE, help="A rig file in place of the recipe's.")
@click.option("--out", type=FILE, default=Path("runs"), show_default=True, help="Where the run's folder is made.")
@click.option("--speed", type=SpeedType(), help="Time scale of the simulated bench, 0.1 to 1000; max: virtual time.")
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
@click.option("--json", "as_json", is_flag=True, help="One event a line, as JSON.")
@click.option("--trace", is_flag=True, help=f"Write every byte into {WIRE_LOG} in the run's folder.")
def run(
    recipe: Path, rig: Path | None, out: Path, speed: Speed | None, quiet: bool, as_json: bool, trace: bool
) -> None:
    """Run a recipe: scan, reduce, fit, and write the results into a folder of their own."""
    from acquisition.control import ScanControl
    from goniometer.console import console_for
    from goniometer.keyboard import keys
    from goniometer.run_recipe import run as run_recipe

    mode, control = mode_of(quiet=quiet, as_json=as_json), ScanControl()
    with keys(control, sys.stdin) as known_keys, console_for(mode, sys.stdout, known_keys) as console:
        stored = run_recipe(
            recipe, rig_path=rig, out=out, speed=speed, trace=trace, subscribers=[console], control=control
        )
    tell_results(stored, mode)


@cli.command()
@click.argument("scene", type=FILE)
@click.option(
    "--speed", type=SpeedType(), default="1", show_default=True, help="Seconds of the bench in a real second."
)
def simulate(scene: Path, speed: Speed) -> None:
    """Serve a scene as a simulated bench, print a rig file with its addresses, and run until Ctrl-C."""
    from goniometer.serve import serve

    serve(scene, speed, sys.stdout)


@cli.command()
@click.argument("kind", type=click.Choice(["recipe", "rig", "scene", "calibration-recipe", "calibration"]))
def schema(kind: Literal["recipe", "rig", "scene", "calibration-recipe", "calibration"]) -> None:
    """Print the JSON Schema of a file, so that an editor completes and checks it."""
    from goniometer.schema import schema as schema_of

    click.echo(json.dumps(schema_of(kind), indent=2))


@cli.command()
def presets() -> None:
    """List the presets that a recipe can include by name."""
    from goniometer.recipe_includes import PRESETS, preset_names

    for name in preset_names():
        first, _, _ = (PRESETS / f"{name}.yaml").read_text(encoding="utf-8").partition("\n")
        click.echo(f"{name:<18} {first.removeprefix('# ')}")


for command in (fit, compare, budget, devices, home, move, read, align, calibrate, stop, runs, resume, export):
    cli.add_command(command)


def main() -> None:
    """Run the command line and exit with the code that this module's docstring lists."""
    try:
        code = cli.main(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        code = error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("Ended by Ctrl-C.", err=True)
        code = 130
    except ScanInterrupted as error:
        _explain(error, f"Ended by {error.reason}. The bench has been stopped.")
        code = error.exit_code
    except ConfigurationError as error:
        _explain(error, str(error))
        code = 2
    except BaseExceptionGroup as group:
        _explain(group, group.message)
        for failure in group.exceptions:
            click.echo(f"  {failure}", err=True)
        code = 1
    except (GoniometerError, OSError) as error:
        _explain(error, str(error))
        code = 1
    sys.exit(code)


def _explain(error: BaseException, message: str) -> None:
    click.echo("\n".join([message, *getattr(error, "__notes__", [])]), err=True)
