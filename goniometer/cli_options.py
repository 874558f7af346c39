"""What options of several commands have in common."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from goniometer.errors import GoniometerError
from goniometer.wire_trace import WIRE_LOG

if TYPE_CHECKING:
    from goniometer.console import Mode
    from goniometer.run_folder import StoredRun

Speed = float | Literal["max"]

FILE = click.Path(path_type=Path)


def _wire_log(context: click.Context, param: click.Parameter, is_asked_for: bool) -> Path | None:
    if not is_asked_for:
        return None
    click.echo(f"Every byte sent and received goes into {WIRE_LOG}", err=True)
    return Path(WIRE_LOG)


TRACE = click.option("--trace", is_flag=True, callback=_wire_log, help=f"Write every byte into {WIRE_LOG}, here.")


def mode_of(*, quiet: bool, as_json: bool) -> Mode:
    """How a scan is shown."""
    if quiet and as_json:
        raise click.UsageError("--quiet and --json exclude each other: choose one.")
    return "quiet" if quiet else "json" if as_json else "auto"


def tell_results(stored: StoredRun, mode: Mode) -> None:
    """Say where a run's results are; raises GoniometerError when its points could not be fitted."""
    if mode == "auto":
        click.echo(f"Everything is in {stored.folder}")
    unfitted = [f"at {one.recipe.one_wavelength_nm:g} nm {one.refusal}" for one in stored.spectrum if one.fit is None]
    if unfitted:
        raise GoniometerError(
            f"The readings are stored in {stored.folder}, but not all could be fitted: {'; '.join(unfitted)}"
        )
    if stored.fit is None and not stored.spectrum:
        raise GoniometerError(
            f"The readings are stored in {stored.folder}, but they could not be fitted: {stored.refusal}"
        )


class Number(click.FloatRange):
    """A finite number, which a floating-point number on a command line need not be."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Turn the command line's text into a number."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a number that can be used.", param, ctx)
        return number


POSITIVE = Number(min=0, min_open=True)


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
