"""Fit one input of many: whatever becomes of it is a row of plain values, and never an error."""

# Nothing heavy is imported here: a worker must know its share of the cores before NumPy counts them.

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from goniometer.many_fits.message import in_a_cell

if TYPE_CHECKING:
    from model.fit import FitResult

Row = dict[str, Any]
"""`status`, `message` and, of what was fitted, `parameters` with value, standard error and at_bound by name, and the
numbers of `MEASURES`; all as JSON holds them."""

OK, REFUSED, UNREADABLE, CRASHED = "ok", "refused", "unreadable", "crashed"
MEASURES = ("chi_square", "degrees_of_freedom", "p_value", "rms")


@dataclass(frozen=True)
class Asked:
    """What to fit: the inputs' own fit sections, or that of a recipe, with some of its keys changed."""

    recipe: Path | None = None
    changes: Mapping[str, Any] = field(default_factory=dict)


def fit_row(path: Path, asked: Asked) -> Row:
    """Fit a run, a NeXus file or a table.

    Parameters
    ----------
    path : Path
        The input.
    asked : Asked
        What to fit.

    Returns
    -------
    dict
        With the status "ok"; "refused" if the values cannot be fitted as asked, "unreadable" if there are none, and
        "crashed" if something happened that the program does not foresee.
    """
    from goniometer.errors import GoniometerError
    from goniometer.fitting.input import fit_input, overridden, read_input, usual_choice, with_recipe

    status = UNREADABLE
    try:
        given, message = read_input(path), ""
        status = REFUSED
        if asked.recipe is not None:
            given = with_recipe(given, asked.recipe)
        choice = given.choice
        if choice is None:
            choice = usual_choice(given.data)
            message = f"The input does not say what to fit; the lobes are {', '.join(choice.lobes)}, all else is free."
        message = " ".join(filter(None, (message, *given.notes)))
        result = fit_input(given, overridden(choice, **asked.changes))
    except (GoniometerError, OSError) as error:
        return {"status": status, "message": in_a_cell(str(error), path)}
    except Exception as error:  # noqa: BLE001 (one input that nobody foresaw must not end the others)
        return crashed(in_a_cell(f"{type(error).__name__}: {error}", path))
    return {"status": OK, "message": message, **_numbers(result)}


def crashed(what: str) -> Row:
    """The row of an input on which the program failed."""
    return {"status": CRASHED, "message": f"{what}. This is a fault of the program; please report it with the input."}


def _numbers(result: FitResult) -> Row:
    from acquisition.fit_points import in_degrees
    from goniometer.plain_json import plain

    shown = in_degrees(result)
    return {
        "parameters": plain(dict(_parameters(shown))),
        **{name: plain(getattr(shown, name)) for name in MEASURES},
    }


def _parameters(shown: FitResult) -> Iterator[tuple[str, tuple[float, float | None, bool]]]:
    for name, estimate in shown.parameters.items():
        yield name, (estimate.value, estimate.stderr, estimate.at_bound)
    for name, value in shown.held.items():
        yield name, (value, None, False)
