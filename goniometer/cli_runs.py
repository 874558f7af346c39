"""The commands about stored runs: list, search, open, export, and the one that goes on with a run."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from goniometer.cli_options import FILE, Speed, SpeedType, mode_of, tell_results
from goniometer.wire_trace import WIRE_LOG


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
@click.option("--rig", type=FILE, help="The run's rig file with other ports.")
@click.option("--speed", type=SpeedType(), help="Time scale of the simulated bench, 0.1 to 1000; max: virtual time.")
@click.option("--sample-untouched", is_flag=True, help="Say that the sample is still mounted as it was.")
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
@click.option("--json", "as_json", is_flag=True, help="One event a line, as JSON.")
@click.option("--trace", is_flag=True, help=f"Write every byte into {WIRE_LOG} in the run's folder.")
def resume(
    run: Path,
    rig: Path | None,
    speed: Speed | None,
    sample_untouched: bool,
    quiet: bool,
    as_json: bool,
    trace: bool,
) -> None:
    """Continue a run that was cut short, at its first missing reading."""
    from acquisition.control import ScanControl
    from goniometer.console import console_for
    from goniometer.keyboard import keys
    from goniometer.resume_run import SAME_SAMPLE, resume

    def is_same_sample() -> bool:
        return sample_untouched or (sys.stdin.isatty() and click.confirm(SAME_SAMPLE, err=True))

    mode, control = mode_of(quiet=quiet, as_json=as_json), ScanControl()
    with keys(control, sys.stdin) as known_keys, console_for(mode, sys.stdout, known_keys) as console:
        resumed = resume(
            run,
            rig_path=rig,
            speed=speed,
            is_same_sample=is_same_sample,
            trace=trace,
            subscribers=[console],
            control=control,
        )
    if resumed.was_finished:
        click.echo(f"{run} was finished already: {len(resumed.run.readings)} readings. Nothing was moved.", err=True)
    tell_results(resumed.run, mode)


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
@click.option("--flat", type=FILE, metavar="FILE", help="Sensitivities of the camera's pixels, from something even.")
def export(run: Path, pbsdf: Path | None, event_model: Path | None, flat: Path | None) -> None:
    """Write a stored run in the format of another program, or a file that a rig names."""
    from goniometer.export_run import export_run

    if pbsdf is None and event_model is None and flat is None:
        raise click.UsageError("Say what to write: --pbsdf FILE, --event-model [FILE] or --flat FILE.")
    for note in export_run(run, pbsdf=pbsdf, event_model=event_model, flat=flat):
        click.echo(note, err=True)
