"""How soon a designed recipe knows n as well as the uniform one, and one of four evenly spread angles.

All in planned bench seconds, on any computer the same. The figures in docs/budget.md come from here.
"""

import math
from pathlib import Path

import numpy as np

from goniometer.budget.assumed_sample import assumed_sample
from goniometer.budget.designed_recipe import designed_recipe
from goniometer.budget.forecast import forecast
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe

RECIPES = Path(__file__).resolve().parent.parent / "recipes"
SAMPLES = ("iron_60deg", "glass_60deg", "alumina_60deg", "pvc_60deg", "rough_iron_60deg")
MOST_READINGS = 10_000


def main():
    for name in SAMPLES:
        setup = load_recipe(RECIPES / f"{name}.yaml")
        recipe, rig, sample = setup.recipe, setup.rig, assumed_sample(setup, ())
        uniform = forecast(recipe, rig, sample)

        def is_as_good(other, rig=rig, sample=sample, wanted=uniform.final["n"]):
            return forecast(other, rig, sample).final["n"] <= wanted

        designed_s = soonest_s(recipe, rig, sample, uniform.duration_s, is_as_good)
        few = of_few(recipe, is_as_good)
        few_s = forecast(few, rig, sample).duration_s if few else math.inf
        print(
            f"{name}: uniform {uniform.duration_s:.0f} s, n ± {uniform.final['n']:.5f}; design {designed_s:.0f} s, "
            f"{designed_s / uniform.duration_s:.0%}; four evenly spread angles {few_s:.0f} s",
            flush=True,
        )


def soonest_s(recipe, rig, sample, duration_s, is_as_good):
    """The shortest time, to 1 s, in which a design for n is as good."""
    low_s, high_s = 0.0, duration_s
    while high_s - low_s > 1.0:
        middle_s = (low_s + high_s) / 2.0
        try:
            enough = is_as_good(designed_recipe(recipe, rig, sample, "n", middle_s))
        except ConfigurationError:
            enough = False
        low_s, high_s = (low_s, middle_s) if enough else (middle_s, high_s)
    return high_s


def of_few(recipe, is_as_good):
    """The recipe of four evenly spread angles with the fewest readings that is as good; None without any."""
    angles_deg = tuple(np.linspace(min(recipe.exit_angles_deg()), max(recipe.exit_angles_deg()), 4).tolist())

    def reading(readings):
        return recipe.model_copy(update={"exit": None, "exit_deg": angles_deg, "readings": readings})

    if not is_as_good(reading(MOST_READINGS)):
        return None
    low, high = 0, MOST_READINGS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_as_good(reading(middle)) else (middle, high)
    return reading(high)


if __name__ == "__main__":
    main()
