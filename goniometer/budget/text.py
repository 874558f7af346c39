"""A budget in words and tables, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from acquisition.recipe import Recipe
from goniometer.budget.assumed_sample import AssumedSample, in_shown_unit, shown
from goniometer.budget.budget import Budget, Outcome
from goniometer.budget.forecast import Forecast
from goniometer.durations import clock_text

_MOMENTS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1)
NOT_DETERMINED = "not determined"
_OPEN = "open"
_NO_GAIN = "none of these changes improves it"


def budget_text(recipe: Recipe, sample: AssumedSample, found: Budget, wanted: str | None) -> str:
    """Tables of the standard errors as the scan goes on and after each change, and the cheapest change in a sentence.

    Parameters
    ----------
    recipe : Recipe
        What was predicted.
    sample : AssumedSample
        What was assumed.
    found : Budget
        What is said.
    wanted : str or None
        The parameter that matters; None for all.
    """
    now = found.now
    names = [wanted] if wanted else list(now.names)
    tables = [
        *_table(["standard errors after", "time", *now.names], _as_it_goes_on(now)),
        "",
        *_table(["changed to", "time", *now.names], [_row(outcome, now) for outcome in found.outcomes]),
    ]
    lines = [
        f"{recipe.recipe}: {_directions(len(now.ends_s))}, {now.readings} readings, {clock_text(now.duration_s)}",
        f"Assumed: {values_text(sample)} ({sample.source})",
        "",
        *tables,
        "",
    ]
    if any(_OPEN in line.split() for line in tables):
        lines.append(
            f"{_OPEN}: {NOT_DETERMINED}; readings do not change with it, or its error is larger than the range in "
            "which the fit searches it."
        )
    return "\n".join([*lines, *_remarks(recipe, now), *(cheapest_text(found, name) for name in names)])


def _remarks(recipe: Recipe, now: Forecast) -> Iterator[str]:
    if now.blind:
        yield undetermined_text(now.blind)
    if recipe.reference is not None:
        yield (
            "Directions share the error of a reference, but the fit, and so these figures, take it for each one's own: "
            "weights of lobes may scatter more, unless the reference is bright."
        )
    if recipe.averaging is not None:
        yield f"This scan averages: {recipe.averaging}. These figures are for the most readings that it may take."
    elif recipe.is_steered:
        yield "This scan steers itself; these figures are for its exit angles as they are listed, once."


def cheapest_text(found: Budget, name: str) -> str:
    """Which change buys a parameter's precision at the lowest price."""
    outcome, before = found.cheapest(name), found.now.final[name]
    if outcome is None:
        verdict = f"{NOT_DETERMINED}, and none of these changes determines it" if math.isinf(before) else _NO_GAIN
        return f"{name}: {verdict}."
    extra_s = outcome.forecast.duration_s - found.now.duration_s
    price = f"for {clock_text(extra_s)} more" if extra_s > 0.0 else f"and saves {clock_text(-extra_s)}"
    after = _number(outcome.forecast.final[name])
    gain = f"determines it to ± {after}" if math.isinf(before) else f"brings ± {_number(before)} down to ± {after}"
    return f"{name}: the cheapest change is {outcome.words}; it {gain} {price}."


def undetermined_text(names: Sequence[str]) -> str:
    """What a recipe can never find out."""
    what = "changes of it" if len(names) == 1 else "changes of these"
    return (
        f"This recipe can never determine {', '.join(names)}: there are {what} that leave every reading the same. "
        f"Measure other directions, or fix {'it' if len(names) == 1 else 'one of them'}."
    )


def values_text(sample: AssumedSample) -> str:
    """The assumed values, with their uncertainty where one is stated."""
    parts = []
    for name, value in sample.values.items():
        stddev = sample.uncertain.get(name)
        error = f" ± {stddev * in_shown_unit(name):g}" if stddev else ""
        parts.append(f"{shown(name)} = {value * in_shown_unit(name):g}{error}")
    return ", ".join(parts)


def design_text(designed: Recipe, expected: Forecast, now: Forecast, wanted: str | None) -> str:
    """A designed recipe, and what it promises beside the recipe as it is."""
    goal = f"for {wanted} (c-optimal)" if wanted else "for all parameters (D-optimal)"
    angles = [f"{angle:g}°" for angle in designed.exit_angles_deg()]
    time = clock_text(expected.duration_s)
    readings = [str(count) for count in designed.readings_of_angles()]
    rows = [
        [name, clock_text(one.duration_s), *map(_number, one.final.values())]
        for name, one in (("the recipe as it is", now), ("the design", expected))
    ]
    return "\n".join(
        [
            f"Design {goal}: {_directions(len(angles))}, {expected.readings} readings, {time}",
            *_table(["exit angle", *angles], [["readings in every slot", *readings]]),
            "",
            *_table(["standard errors", "time", *now.names], rows),
        ]
    )


def as_json(title: str, sample: AssumedSample, found: Budget) -> dict[str, Any]:
    """The same as plain numbers; a parameter that is not determined has the standard error null."""
    now = found.now
    return {
        "recipe": title,
        "assumed": {shown(name): value * in_shown_unit(name) for name, value in sample.values.items()},
        "source": sample.source,
        **forecast_json(now),
        "undetermined": list(now.undetermined),
        "scan": [
            {"bench_s": float(end_s), "stderr": _finite(dict(zip(now.names, row.tolist(), strict=True)))}
            for end_s, row in zip(now.ends_s, now.stderr, strict=True)
        ],
        "changes": [{"change": outcome.words, **forecast_json(outcome.forecast)} for outcome in found.outcomes],
        "cheapest": {
            name: outcome.words if (outcome := found.cheapest(name)) is not None else None for name in now.names
        },
    }


def forecast_json(expected: Forecast) -> dict[str, Any]:
    """Duration, readings and final standard errors."""
    return {
        "directions": len(expected.ends_s),
        "readings": expected.readings,
        "bench_s": expected.duration_s,
        "stderr": _finite(expected.final),
    }


def _finite(stderrs: Mapping[str, float]) -> dict[str, float | None]:
    return {name: stderr if math.isfinite(stderr) else None for name, stderr in stderrs.items()}


def _as_it_goes_on(now: Forecast) -> Iterator[list[str]]:
    moments_s = [share * now.duration_s for share in _MOMENTS]
    for place in dict.fromkeys(np.searchsorted(now.ends_s, moments_s).tolist()):
        stderrs = map(_number, now.stderr[place].tolist())
        yield [_directions(place + 1), clock_text(float(now.ends_s[place])), *stderrs]


def _directions(count: int) -> str:
    return f"{count} direction{'s' * (count != 1)}"


def _row(outcome: Outcome, now: Forecast) -> list[str]:
    extra_s = outcome.forecast.duration_s - now.duration_s
    sign = "+" if extra_s >= 0.0 else "-"
    return [outcome.words, f"{sign}{clock_text(abs(extra_s))}", *map(_number, outcome.forecast.final.values())]


def _number(stderr: float) -> str:
    return f"{stderr:.2g}" if math.isfinite(stderr) else _OPEN


def _table(head: Sequence[str], rows: Iterable[list[str]]) -> list[str]:
    texts = [list(head), *rows]
    widths = [max(len(row[column]) for row in texts) for column in range(len(head))]
    return [
        "  ".join(
            [row[0].ljust(widths[0]), *(text.rjust(width) for text, width in zip(row[1:], widths[1:], strict=True))]
        )
        for row in texts
    ]
