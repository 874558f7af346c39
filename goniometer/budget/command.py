"""What ``goniometer budget`` does: predict what a recipe will reach, draw it, write a recipe that reaches more."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from goniometer.budget.assumed_sample import AssumedSample, assumed_sample, shown
from goniometer.budget.budget import budget
from goniometer.budget.designed_recipe import designed_recipe
from goniometer.budget.forecast import Forecast, forecast
from goniometer.budget.rewritten_recipe import moved, rewritten_recipe, write_new
from goniometer.budget.text import as_json, budget_text, design_text, forecast_json, values_text
from goniometer.durations import clock_text
from goniometer.errors import ConfigurationError
from goniometer.load_files import Setup, load_recipe

CriterionName = Literal["d", "c"]


@dataclass(frozen=True)
class BudgetAsked:
    """What a person asks of a recipe.

    Parameters
    ----------
    recipe : Path
        The recipe.
    rig : Path or None
        A rig file in place of the recipe's.
    wanted : str or None
        The parameter that matters.
    assumptions : sequence of str
        What is expected of the sample, such as ``n=1.5``; a recipe with a scene needs none.
    plot : Path or None
        The picture to draw.
    design : Path or None
        The recipe to write.
    time_s : float or None
        Bench time that it may take; as much as the recipe takes as it is if None.
    criterion : "c" or "d"
        Whether it serves the wanted parameter, or all alike.
    """

    recipe: Path
    rig: Path | None
    wanted: str | None
    assumptions: Sequence[str]
    plot: Path | None
    design: Path | None
    time_s: float | None
    criterion: CriterionName


@dataclass(frozen=True)
class BudgetReport:
    """What was found: `text` for a person, `data` for JSON."""

    text: str
    data: dict[str, Any]


def run_budget(asked: BudgetAsked) -> BudgetReport:
    """Predict a recipe's precision, and draw it or write a designed recipe where that is asked for.

    Raises
    ------
    ConfigurationError
        When a file cannot be used or written, an assumption cannot be kept, or there is no design.
    """
    setup = load_recipe(asked.recipe, asked.rig)
    recipe, rig = setup.recipe, setup.rig
    if recipe.generator_deg is not None:
        raise ConfigurationError(
            [f"{asked.recipe}: measures Mueller matrices, and budget foresees the errors of Stokes parameters alone."]
        )
    if recipe.analyzer_rotation is not None:
        raise ConfigurationError(
            [
                f"{asked.recipe}: its analyzer turns while it is read (analyzer_rotation), and budget foresees slots "
                "alone. Nothing was predicted. Write analyzer_deg in its place, with a quarter of the readings of all "
                "turns in each of 0, 45, 90 and 135 degrees: the errors are the same."
            ]
        )
    if len(recipe.wavelengths_nm()) > 1:
        listed = ", ".join(f"{wavelength_nm:g}" for wavelength_nm in recipe.wavelengths_nm())
        raise ConfigurationError(
            [
                f"{asked.recipe} measures at several wavelengths ({listed} nm), each with a fit of its own. Nothing "
                "was predicted. Write one of them as wavelength_nm, and ask for each."
            ]
        )
    sample = assumed_sample(setup, asked.assumptions)
    names = [shown(name) for name in sample.values]
    if asked.wanted is not None and asked.wanted not in names:
        raise ConfigurationError(
            [f"--for {asked.wanted}: the recipe's fit does not search it. Choose one of {', '.join(names)}."]
        )
    found = budget(recipe, rig, sample, asked.wanted)
    text = budget_text(recipe, sample, found, asked.wanted)
    data = as_json(recipe.recipe, sample, found)
    expected = None
    if asked.design is not None:
        time_s = found.now.duration_s if asked.time_s is None else asked.time_s
        wanted = asked.wanted if asked.criterion == "c" else None
        designed = designed_recipe(recipe, rig, sample, wanted, time_s)
        expected = forecast(designed, rig, sample)
        text = f"{text}\n\n{design_text(designed, expected, found.now, wanted)}\n\nIt stands in {asked.design}."
        data["design"] = {
            "file": str(asked.design),
            "exit_deg": list(designed.exit_angles_deg()),
            "readings_in_every_slot": list(designed.readings_of_angles()),
            **forecast_json(expected),
        }
        there = moved(setup.recipe_text, asked.recipe.parent, asked.design.parent)
        write_new(asked.design, rewritten_recipe(there, designed, _comments(asked, setup, sample, time_s, expected)))
    if asked.plot is not None:
        from goniometer.budget.plot import draw_budget

        assumed = values_text(sample)
        draw_budget(asked.plot, title=recipe.recipe, assumed=assumed, found=found, wanted=asked.wanted, design=expected)
    return BudgetReport(text, data)


def _comments(
    asked: BudgetAsked, setup: Setup, sample: AssumedSample, time_s: float, expected: Forecast
) -> tuple[str, ...]:
    """What the written recipe says of its origin."""
    options = ["--design", str(asked.design), "--time", f"{time_s:.6g}", "--criterion", asked.criterion]
    options += ["--rig", str(asked.rig)] if asked.rig else []
    options += ["--for", asked.wanted] if asked.wanted else []
    options += [part for assumption in asked.assumptions for part in ("--assume", assumption)]
    goal = f"{asked.wanted} best (c-optimal)" if asked.criterion == "c" else "all parameters best (D-optimal)"
    stderrs = ", ".join(f"{name} ± {stderr:.2g}" for name, stderr in expected.final.items())
    return (
        f"Exit angles and readings by: {shlex.join(['goniometer', 'budget', str(asked.recipe), *options])}",
        f"They determine {goal} in {clock_text(expected.duration_s)} if the sample is as assumed:",
        f"{values_text(sample)} ({sample.source}).",
        f"Expected: {stderrs}.",
        "",
    )
