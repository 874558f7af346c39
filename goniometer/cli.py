"""The command line.

Exit codes: 0 done; 1 a device, the data or the disk failed; 2 a recipe, rig, scene or the command line cannot be used;
130, 143, 129 the scan was ended by Ctrl-C, SIGTERM, SIGHUP. Whatever the code, the bench has been stopped and the
readings that were shown are stored.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from goniometer import __version__
from goniometer.errors import ConfigurationError, GoniometerError, ScanInterrupted

if TYPE_CHECKING:
    from goniometer.rig_devices.entry import Role

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
@click.argument("paths", type=_FILE, metavar="RUN|FILE...", nargs=-1, required=True)
@click.option("--recipe", type=_FILE, help="A recipe whose fit section says what to fit, in place of the run's own.")
@click.option(
    "--objective", type=click.Choice(["stokes", "normalised", "dolp", "rms"]), help="What is compared; see docs/fit.md."
)
@click.option("--robust", is_flag=True, help="Let outliers count less.")
@click.option("--search", type=click.Choice(["sobol", "genetic"]), help="How starting values are found.")
@click.option("--profile", "profiled", multiple=True, metavar="NAME", help="Follow the likelihood of a parameter, too.")
@click.option("--bootstrap", type=click.IntRange(2, 100_000), metavar="N", help="Fit data made anew N times, too.")
@click.option("--json", "as_json", is_flag=True, help="Print the fit as JSON.")
@click.option("--out", type=_FILE, help="Write the fit as JSON into this file, too; of many, a .csv or .parquet table.")
@click.option("--workers", type=click.IntRange(1), help="Many inputs: how many processes; one a core by default.")
@click.option("--scheduler", metavar="tcp://…", help="Many inputs: a Dask scheduler whose workers fit them.")
@click.option("--resume", is_flag=True, help="Many inputs: leave those that are done and have not changed.")
def fit(
    paths: tuple[Path, ...],
    recipe: Path | None,
    objective: str | None,
    robust: bool,
    search: str | None,
    profiled: tuple[str, ...],
    bootstrap: int | None,
    as_json: bool,
    out: Path | None,
    workers: int | None,
    scheduler: str | None,
    resume: bool,
) -> None:
    """Fit a stored run, a NeXus file or a table of measured values; or many of them, into one table.

    A run that is fitted as its own recipe says gets its results written anew; otherwise only --out writes a file.
    Of many inputs the table is all that is written.
    """
    changes = {"objective": objective, "robust": robust or None, "search": search}
    changes = {key: value for key, value in changes.items() if value is not None}
    if len(paths) > 1 or workers or scheduler or resume or (out and out.suffix.lower() in (".csv", ".parquet")):
        if out is None or as_json or profiled or bootstrap:
            raise click.UsageError(
                "Many inputs become one table: name its file with --out; leave --json, --profile and --bootstrap out."
            )
        if workers and scheduler:
            raise click.UsageError("--workers and --scheduler exclude each other: choose one.")
        from goniometer.many_fits.fit_many import fit_files
        from goniometer.many_fits.row import Asked

        asked = Asked(recipe, changes)
        many = fit_files(paths, out, asked, sys.stderr, workers=workers, scheduler=scheduler, resume=resume)
        if not many.all_fitted:
            raise GoniometerError(str(many))
        click.echo(many)
        return
    from goniometer.fitting.command import fit_one

    if out is not None:
        from goniometer.output_file import require_output

        require_output(out, (".json",), [*paths, *([recipe] if recipe else [])])
    fitted = fit_one(paths[0], recipe, changes, profiled=profiled, bootstrapped=bootstrap or 0)
    for note in fitted.notes:
        click.echo(note, err=True)
    if out is not None:
        fitted.write_json(out)
        click.echo(f"wrote {out}", err=True)
    click.echo(fitted.json_text() if as_json else fitted.summary(), nl=not as_json)


@cli.command()
@click.argument("path", type=_FILE, metavar="RUN|FILE")
@click.option("--recipe", type=_FILE, help="A recipe whose fit section says what is known, in place of the run's own.")
@click.option(
    "--objective", type=click.Choice(["stokes", "normalised", "dolp", "rms"]), help="What is compared; see docs/fit.md."
)
@click.option("--json", "as_json", is_flag=True, help="Print the comparison as JSON.")
@click.option("--plot", type=_FILE, help="Draw the data and every model into this PNG file.")
def compare(
    path: Path,
    recipe: Path | None,
    objective: Literal["stokes", "normalised", "dolp", "rms"] | None,
    as_json: bool,
    plot: Path | None,
) -> None:
    """Fit the published models and our own to the same data, and rank them by how well they describe it."""
    from goniometer.compare.command import compare_models
    from goniometer.compare.text import compare_text
    from goniometer.output_file import require_output

    if plot is not None:
        require_output(plot, (".png",), [path, *([recipe] if recipe else [])])
    found = compare_models(path, recipe, objective)
    click.echo(found.json_text() if as_json else compare_text(found))
    if plot is not None:
        from goniometer.compare.plot import draw_comparison

        draw_comparison(plot, found)
        click.echo(f"wrote {plot}", err=True)


@cli.command()
@click.argument("recipe", type=_FILE)
@click.option("--rig", type=_FILE, help="A rig file in place of the recipe's.")
@click.option("--for", "wanted", metavar="PARAMETER", help="The parameter that matters, for example n.")
@click.option(
    "--assume", "assumptions", multiple=True, metavar="NAME=VALUE", help="What is expected, in place of the scene's."
)
@click.option("--plot", type=_FILE, help="Draw standard errors against bench time into this PNG file.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@click.option("--design", type=_FILE, help="Write a recipe with the best exit angles and readings into this file.")
@click.option("--time", "time_s", type=click.FloatRange(0, min_open=True), help="Its bench time in s; else the same.")
@click.option("--criterion", type=click.Choice(["d", "c"]), help="Best for all alike (d), or for --for (c).")
def budget(
    recipe: Path,
    rig: Path | None,
    wanted: str | None,
    assumptions: tuple[str, ...],
    plot: Path | None,
    as_json: bool,
    design: Path | None,
    time_s: float | None,
    criterion: Literal["d", "c"] | None,
) -> None:
    """Predict a recipe's standard errors before the scan, and what changes would cost and gain. Moves nothing."""
    from goniometer.budget.command import BudgetAsked, run_budget
    from goniometer.output_file import require_output

    if design is None and (time_s is not None or criterion is not None):
        raise click.UsageError("--time and --criterion are about a design: name its file with --design.")
    if criterion == "c" and wanted is None:
        raise click.UsageError("--criterion c needs a parameter: name it with --for.")
    if plot is not None:
        require_output(plot, (".png",), [recipe])
    criterion = criterion or ("c" if wanted else "d")
    report = run_budget(BudgetAsked(recipe, rig, wanted, assumptions, plot, design, time_s, criterion))
    click.echo(json.dumps(report.data, indent=2) if as_json else report.text)


_RIG = click.option("--rig", type=_FILE, required=True, help="The rig file of the bench.")
_AXIS = click.Choice(["source_arm", "detector_arm", "sample_azimuth", "polarizer"])


@cli.command()
@click.option("--port", "ports", multiple=True, metavar="PORT", help="Ask here only: COM3, /dev/ttyUSB0, socket://…")
@click.option("--rig", type=_FILE, help="Check what a rig file expects, at its ports.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def devices(ports: tuple[str, ...], rig: Path | None, as_json: bool) -> None:
    """List serial ports and which known devices answer there. Moves nothing and changes no setting."""
    from goniometer.bench_commands.devices import devices as find_devices
    from goniometer.plain_json import plain

    found = find_devices(ports, rig, _note)
    click.echo(json.dumps(plain(found), indent=2) if as_json else found)
    if not found.all_there:
        raise GoniometerError("Not every device of the rig file is there: see above.")


@cli.command()
@_RIG
@click.option(
    "--axis", "roles", type=_AXIS, multiple=True, help="An axis to home; all, one by one, when none is given."
)
@click.option("--way-is-clear", is_flag=True, help="You have looked: the axis can touch nothing, wherever it goes.")
def home(rig: Path, roles: tuple[Role, ...], way_is_clear: bool) -> None:
    """Search each stage's zero, one axis after the other. Moves axes on ways that nobody knows beforehand."""
    from goniometer.bench_commands.home import home as home_axes

    home_axes(rig, roles, click.echo, _note, way_is_clear=way_is_clear)


@cli.command(context_settings={"ignore_unknown_options": True})  # an angle below zero is no option
@_RIG
@click.argument("axis", type=_AXIS)
@click.argument("deg", type=float)
def move(rig: Path, axis: Role, deg: float) -> None:
    """Move one axis to an angle in degrees, and say where it came to stand."""
    from goniometer.bench_commands.move import move as move_axis

    move_axis(rig, axis, deg, click.echo, _note)


@cli.command()
@_RIG
@click.option(
    "--exposure", "exposure_s", type=click.FloatRange(0, min_open=True), help="Of one reading, in s; else 0.1."
)
@click.option("--slot", type=int, help="Bring this slot of the analyzer into the beam first.")
@click.option("--count", type=click.IntRange(1, 100_000), default=5, show_default=True, help="How many readings.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def read(rig: Path, exposure_s: float | None, slot: int | None, count: int, as_json: bool) -> None:
    """Read where every axis stands, the analyzer's slot, and the power at the detector. Moves no axis."""
    from goniometer.bench_commands.measuring import USUAL_EXPOSURE_S
    from goniometer.bench_commands.read import read as read_bench
    from goniometer.plain_json import plain

    reading = read_bench(rig, exposure_s or USUAL_EXPOSURE_S, slot, count, _note)
    click.echo(json.dumps(plain(reading), indent=2) if as_json else reading)


@cli.command()
@_RIG
@click.option("--axis", type=click.Choice(["source_arm", "detector_arm"]), required=True, help="The arm to scan.")
@click.option("--from", "from_deg", type=float, required=True, help="Where the scan begins, in degrees.")
@click.option("--to", "to_deg", type=float, required=True, help="Where it ends.")
@click.option("--step", "step_deg", type=click.FloatRange(0, min_open=True), help="Between points; else 40 steps.")
@click.option("--store", is_flag=True, help="Write the zero that was found into the rig file.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def align(
    rig: Path,
    axis: Literal["source_arm", "detector_arm"],
    from_deg: float,
    to_deg: float,
    step_deg: float | None,
    store: bool,
    as_json: bool,
) -> None:
    """Find an arm's true zero from the reflection of a mirror in the sample's place. Scans the arm."""
    from goniometer.bench_commands.align import advice
    from goniometer.bench_commands.align import align as align_arm
    from goniometer.plain_json import plain

    found = align_arm(rig, axis, from_deg, to_deg, step_deg, _note, store=store)
    click.echo(json.dumps(plain(found), indent=2) if as_json else f"{found}\n{advice(found, rig)}")


@cli.command()
@_RIG
def stop(rig: Path) -> None:
    """Stop everything at once, also a scan that another process runs on the same ports."""
    from goniometer.bench_commands.stop import stop as stop_bench

    if not stop_bench(rig, click.echo):
        raise GoniometerError("Not everything was stopped: see above. Cut the power of what still moves.")


def _note(line: str) -> None:
    click.echo(line, err=True)


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
