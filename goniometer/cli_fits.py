"""The commands that fit measured values, compare models and plan what to measure."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Literal

import click

from goniometer.cli_options import FILE, POSITIVE
from goniometer.errors import GoniometerError


@click.command()
@click.argument("paths", type=FILE, metavar="RUN|FILE...", nargs=-1, required=True)
@click.option("--recipe", type=FILE, help="A recipe whose fit section says what to fit, in place of the run's own.")
@click.option(
    "--objective", type=click.Choice(["stokes", "normalised", "dolp", "rms"]), help="What is compared; see docs/fit.md."
)
@click.option("--robust", is_flag=True, help="Let outliers count less.")
@click.option("--search", type=click.Choice(["sobol", "genetic"]), help="How starting values are found.")
@click.option("--profile", "profiled", multiple=True, metavar="NAME", help="Follow the likelihood of a parameter, too.")
@click.option("--bootstrap", type=click.IntRange(2, 100_000), metavar="N", help="Fit data made anew N times, too.")
@click.option("--json", "as_json", is_flag=True, help="Print the fit as JSON.")
@click.option("--out", type=FILE, help="Write the fit as JSON into this file, too; of many, a .csv or .parquet table.")
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


@click.command()
@click.argument("path", type=FILE, metavar="RUN|FILE")
@click.option("--recipe", type=FILE, help="A recipe whose fit section says what is known, in place of the run's own.")
@click.option(
    "--objective", type=click.Choice(["stokes", "normalised", "dolp", "rms"]), help="What is compared; see docs/fit.md."
)
@click.option("--json", "as_json", is_flag=True, help="Print the comparison as JSON.")
@click.option("--plot", type=FILE, help="Draw the data and every model into this PNG file.")
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


@click.command()
@click.argument("recipe", type=FILE)
@click.option("--rig", type=FILE, help="A rig file in place of the recipe's.")
@click.option("--for", "wanted", metavar="PARAMETER", help="The parameter that matters, for example n.")
@click.option(
    "--assume", "assumptions", multiple=True, metavar="NAME=VALUE", help="What is expected, in place of the scene's."
)
@click.option("--plot", type=FILE, help="Draw standard errors against bench time into this PNG file.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@click.option("--design", type=FILE, help="Write a recipe with the best exit angles and readings into this file.")
@click.option("--time", "time_s", type=POSITIVE, help="Its bench time in s; else the same.")
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
