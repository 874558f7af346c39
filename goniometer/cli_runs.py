"""The commands about stored runs: list, search, open, export."""

from __future__ import annotations

from pathlib import Path

import click

from goniometer.cli_options import FILE


@click.command()
@click.argument("words", metavar="[TEXT]...", nargs=-1)
@click.option("--in", "folder", type=FILE, default=Path("runs"), show_default=True, help="The folder with the runs.")
@click.option("--open", "name", metavar="N|NAME", help="Show the report of run N of the list, or of that name.")
def runs(words: tuple[str, ...], folder: Path, name: str | None) -> None:
    """List the stored runs, the newest first; with TEXT those that have it in their name, recipe or provenance."""
    from goniometer.catalogue.listing import catalogue, picked
    from goniometer.catalogue.text import catalogue_text

    found = catalogue(folder, words)
    if name is not None:
        run = picked(found, name).folder
        report = run / "report.png"
        shown = report if report.exists() else run
        click.echo(shown)
        if click.launch(str(shown)) != 0:
            click.echo("Nothing here shows such a file: open it yourself.", err=True)
    elif found:
        click.echo(catalogue_text(found))
    else:
        click.echo(f"No run in {folder}{' has ' + ' and '.join(words) if words else ''}.", err=True)


@click.command()
@click.argument("run", type=FILE, metavar="RUN")
@click.option("--pbsdf", type=FILE, metavar="FILE", help="The fitted surface, for Mitsuba's measured_polarized.")
@click.option(
    "--event-model",
    type=FILE,
    metavar="[FILE]",
    is_flag=False,
    flag_value=Path("-"),
    help="The readings as documents of Bluesky's event model, one a line; without FILE to the standard output.",
)
def export(run: Path, pbsdf: Path | None, event_model: Path | None) -> None:
    """Write a stored run in the format of another program."""
    from goniometer.export_run import export_run

    if pbsdf is None and event_model is None:
        raise click.UsageError("Say what to write: --pbsdf FILE or --event-model [FILE].")
    for note in export_run(run, pbsdf=pbsdf, event_model=event_model):
        click.echo(note, err=True)
