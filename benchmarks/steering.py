"""What an adaptive scan is worth: beside the design that knew the sample, and beside the uniform recipe.

Whole scans on the simulated bench, every byte over a socket. The figures in docs/steering.md come from here.
"""

import tempfile
from pathlib import Path

import numpy as np
import yaml

import goniometer
from acquisition.events import ScanEnded
from acquisition.expand import HOME, Visits
from acquisition.expected_noise import expected_points, light_of
from acquisition.fit_points import dataset, surface_family
from acquisition.timing import READING_S
from goniometer.load_files import load_recipe
from goniometer.planning import detection, plan, slots, timing
from model.design.design import Criterion
from model.design.information import information, standard_errors
from model.design.timed_design import timed_design

ROOT = Path(__file__).resolve().parent.parent
SEEDS = range(1, 11)
TIMES_S = (60.0, 100.0, 150.0, 200.0, 300.0)
MOST_READINGS = 10_000


def scan(folder, sample, seed, **changes):
    """Standard error and error of n, and bench time, of a scan of a variant of a shipped recipe."""
    recipe = yaml.safe_load((ROOT / "recipes" / f"{sample}_60deg.yaml").read_text()) | changes
    scene = yaml.safe_load((ROOT / "scenes" / f"{sample}.yaml").read_text()) | {"seed": seed}
    scene["rig"] = recipe["rig"] = str(ROOT / "rigs" / "simulated.yaml")
    recipe["scene"] = str(folder / "scene.yaml")
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene))
    (folder / "recipe.yaml").write_text(yaml.safe_dump(recipe))
    ends = []

    def note_end(event):
        if isinstance(event, ScanEnded):
            ends.append(event.bench_duration_s)

    stored = goniometer.run(folder / "recipe.yaml", out=folder / "runs", speed="max", subscribers=[note_end])
    n = stored.fit.parameters["n"]
    return n.stderr, (n.value - stored.truth["n"]) / n.stderr, ends[0], len(stored.points)


class BestDesign:
    """The design for n that knows the sample, with the same exit angles, devices and overheads."""

    def __init__(self, sample):
        setup = load_recipe(ROOT / "recipes" / f"{sample}_60deg.yaml")
        self._recipe, rig = setup.recipe, setup.rig
        family = surface_family(self._recipe.fit, rig.calibration.acceptance_sr)
        truth = setup.scene.truth()
        values = {name: truth[name] for name in family.names}
        once = self._recipe.model_copy(update={"readings": 1})
        data = dataset(expected_points(plan(once, rig), light_of(family.seen(values)), detection(once, rig)))
        self._pieces = information(family, data.directions, data.covariance, values)
        self._visits = Visits(self._recipe, slots(rig), timing(rig))
        self._n = family.names.index("n")

    def _cost(self, places):
        here, total_s = HOME, 0.0
        for place in places:
            steps = self._visits.steps(1, self._recipe.exit_angles_deg()[place], 0, here)
            here, total_s = steps[-1].target, total_s + sum(step.duration_s for step in steps)
        return total_s, np.full(len(places), 5 * (self._recipe.exposure_s + READING_S))

    def stderr(self, time_s):
        """Standard error of n after a time."""
        wanted = Criterion(np.eye(self._pieces.shape[-1])[self._n])
        readings = timed_design(self._pieces[None], wanted, self._cost, time_s, MOST_READINGS)
        return float(standard_errors(np.einsum("n,npq->pq", readings, self._pieces))[self._n])


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for sample in ("iron", "glass"):
            best = BestDesign(sample)
            uniform, _, uniform_s, _ = scan(folder, sample, 1)
            print(f"{sample}: uniform 1° recipe: n ± {uniform:.5f} after {uniform_s:.0f} s")
            for time_s in TIMES_S:
                known = best.stderr(time_s)
                at_time = np.array(
                    [
                        scan(folder, sample, seed, adaptive=True, until={"n": 1e-6}, time_limit_s=time_s)
                        for seed in SEEDS
                    ]
                )
                until = np.array(
                    [
                        scan(folder, sample, seed, adaptive=True, until={"n": known}, time_limit_s=3000.0)
                        for seed in SEEDS
                    ]
                )
                ratio, longer = at_time[:, 0] / known, until[:, 2] / time_s
                off = np.sqrt(np.mean(np.concatenate([at_time[:, 1], until[:, 1]]) ** 2))
                uniform_longer = uniform_s * (uniform / known) ** 2 / np.mean(until[:, 2])
                print(
                    f"  {time_s:3.0f} s: best design n ± {known:.5f}; after the same time {_range(ratio)} times that; "
                    f"as good after {_range(longer)} times the time, the uniform recipe after {uniform_longer:.1f} "
                    f"times as long as that; errors of n {off:.2f} standard errors rms",
                    flush=True,
                )


def _range(values):
    return f"{np.mean(values):.2f} ({np.min(values):.2f} to {np.max(values):.2f})"


if __name__ == "__main__":
    main()
