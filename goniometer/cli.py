"""The command line.

Exit codes: 0 done; 1 a device, the data or the disk failed; 2 a recipe, rig, scene or the command line cannot be used;
130, 143, 129 the scan was ended by Ctrl-C, SIGTERM, SIGHUP. Whatever the code, the bench has been stopped and the
readings that were shown are stored.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Literal

import click

from goniometer import __version__
from goniometer.errors import ConfigurationError, GoniometerError, ScanInterrupted

Speed = float | Literal["max"]

_FILE = click.Path(path_type=Path)


class SpeedType(click.ParamType[Speed]):
    """A positive number, or ``max``."""

    name = "N|max"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> Speed:
        """Turn the command line's text into a speed."""
        if value == "max":
            return "max"
        try:
            speed = float(value)
        except ValueError:
            speed = 0.0
        if not 0.1 <= speed <= 1000.0:
            self.fail(f"'{value}' is not a speed: write a number from 0.1 to 1000, or max", param, ctx)
        return speed


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="goniometer")
def cli() -> None:
    """Run a polarimetric goniometer from a YAML recipe and fit the material while it scans."""


@cli.command()
@click.argument("file", type=_FILE)
@click.option("--rig", type=_FILE, help="A rig file in place of the recipe's.")
def check(file: Path, rig: Path | None) -> None:
    """Check a recipe with its rig and scene, and print its steps and their duration. Moves nothing.

    A rig or a scene can be checked alone.
    """
    from goniometer.check import describe_plan
    from goniometer.load_files import Setup, load_file, load_recipe

    loaded = load_recipe(file, rig) if rig else load_file(file)
    click.echo(describe_plan(loaded) if isinstance(loaded, Setup) else f"{file} is valid.")


@cli.command()
@click.argument("recipe", type=_FILE)
@click.option("--rig", type=_FILE, help="A rig file in place of the recipe's.")
@click.option("--out", type=_FILE, default=Path("runs"), show_default=True, help="Where the run's folder is made.")
@click.option("--speed", type=SpeedType(), help="Time scale of the simulated bench, 0.1 to 1000; max: virtual time.")
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
@click.option("--json", "as_json", is_flag=True, help="One event a line, as JSON.")
def run(recipe: Path, rig: Path | None, out: Path, speed: Speed | None, quiet: bool, as_json: bool) -> None:
    """Run a recipe: scan, reduce, fit, and write the results into a folder of their own."""
    from goniometer.console import Mode, console_for
    from goniometer.run_recipe import run as run_recipe

    if quiet and as_json:
        raise click.UsageError("--quiet and --json exclude each other: choose one.")
    mode: Mode = "quiet" if quiet else "json" if as_json else "auto"
    with console_for(mode, sys.stdout) as console:
        stored = run_recipe(recipe, rig_path=rig, out=out, speed=speed, subscribers=[console])
    if mode == "auto":
        click.echo(f"Everything is in {stored.folder}")
    if stored.fit is None:
        raise GoniometerError(
            f"The readings are stored in {stored.folder}, but they could not be fitted: {stored.refusal}"
        )


@cli.command()
@click.argument("scene", type=_FILE)
@click.option(
    "--speed", type=SpeedType(), default="1", show_default=True, help="Seconds of the bench in a real second."
)
def simulate(scene: Path, speed: Speed) -> None:
    """Serve a scene as a simulated bench, print a rig file with its addresses, and run until Ctrl-C."""
    from goniometer.serve import serve

    serve(scene, speed, sys.stdout)


@cli.command()
@click.argument("run_folder", type=_FILE, metavar="RUN")
def fit(run_folder: Path) -> None:
    """Reduce and fit the stored readings of a run again, and write its results anew."""
    from goniometer.fit_summary import fit_summary
    from goniometer.run_folder import load, write_results

    stored = load(run_folder)
    for path in write_results(stored):
        click.echo(f"wrote {path}", err=True)
    if stored.fit is None:
        raise GoniometerError(f"{stored.folder}: {len(stored.points)} points could not be fitted: {stored.refusal}")
    click.echo(fit_summary(stored.fit, stored.truth))


@cli.command()
@click.argument("kind", type=click.Choice(["recipe", "rig", "scene"]))
def schema(kind: Literal["recipe", "rig", "scene"]) -> None:
    """Print the JSON Schema of a file, so that an editor completes and checks it."""
    from goniometer.schema import schema as schema_of

    click.echo(json.dumps(schema_of(kind), indent=2))


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
        _explain(error, f"The scan was ended by {error.reason}. The bench has been stopped.")
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
