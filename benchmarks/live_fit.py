"""What a fit costs while a scan runs, beside lmfit and Bluesky's LiveFit, and what a search from nothing costs.

Run with ``make bench-fit``; the figures in docs/cost.md come from here. Everything is in one process: the peers get the
project's own compiled model with its derivatives where they take them.
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import lmfit
import numpy as np
from bluesky.callbacks.fitting import LiveFit

from model.fit import Dataset, fit, follow, lobe_family
from model.geometry import in_plane

FAMILY = lobe_family(("specular", "diffuse", "directional"), {"sigma": (0.02, 1.0), "n": (0.1, 8.0), "k": (0.0, 10.0)})
GLASSES = lobe_family(("specular", "diffuse", "directional"), {"sigma": (0.02, 1.0), "n": (1.0, 4.0)}, {"k": 0.0})
IRON = {"sigma": 0.1764, "n": 2.95, "k": 2.932, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}


def scan(values, exit_deg, seed, family=FAMILY):
    """Stokes parameters at 60° incidence with a noise of 1e-3 of the signal."""
    random = np.random.default_rng(seed)
    exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
    incidence_rad = np.full(len(exit_deg), np.radians(60.0))
    stokes = family.seen(values).stokes(incidence_rad, exit_rad, azimuth_rad)[:, :3]
    stddev = np.hypot(1e-5, 1e-3 * stokes[:, :1]) * np.ones(3)
    noisy = stokes + stddev * random.standard_normal(stokes.shape)
    return Dataset(incidence_rad, exit_rad, azimuth_rad, noisy, stddev[:, :, None] ** 2 * np.eye(3))


def stokes(exit_deg, sigma, n, k, rho_s, rho_d, rho_dd):
    """The model as a peer calls it: S0, S1, S2 side by side."""
    values = {"sigma": sigma, "n": n, "k": k, "rho_s": rho_s, "rho_d": rho_d, "rho_dd": rho_dd}
    exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
    light = FAMILY.surface_of(values).stokes(np.full(len(exit_rad), np.radians(60.0)), exit_rad, azimuth_rad)
    return light[:, :3].ravel()


def s0(exit_deg, sigma, n, k, rho_s, rho_d, rho_dd):
    """S0 alone, for a peer that knows one column."""
    return stokes(np.atleast_1d(exit_deg), sigma, n, k, rho_s, rho_d, rho_dd)[::3]


def hints():
    """The parameters as peers take them."""
    parameters = lmfit.Parameters()
    for name, value in IRON.items():
        low, high = FAMILY.free[name]
        parameters.add(name, value, min=low, max=high)
    return parameters


def timed(call, *arguments, **options):
    start = time.perf_counter()
    result = call(*arguments, **options)
    return 1e3 * (time.perf_counter() - start), result


def followed(so_far, new, last):
    """What a live fit does with a new point."""
    return follow(so_far.joined(new), FAMILY, last)


def live_updates(points, updates):
    """Milliseconds of each of the last updates of a scan of many points: ours, and lmfit's from the last optimum."""
    exit_deg = np.linspace(0.0, 60.0, points)
    random = np.random.default_rng(5)
    order = random.permutation(points)  # so that the angles cover the range before the last come in
    data = scan(IRON, exit_deg, 1)
    counts = range(points - updates, points + 1)
    so_far = data.some(order[: counts[0]])
    last = fit(so_far, FAMILY)
    model, parameters = lmfit.Model(stokes), hints()
    ours, theirs = [], []
    for count in counts[1:]:
        new = data.some(order[count - 1 : count])
        took, last = timed(followed, so_far, new, last)
        ours.append(took)
        so_far = so_far.joined(new)
        if len(theirs) < max(3, updates // 5):
            for name, value in last.values.items():
                parameters[name].set(value=value)
            weights = 1.0 / np.sqrt(so_far.covariance.diagonal(axis1=1, axis2=2)).ravel()
            values, angles = so_far.values.ravel(), exit_deg[order[:count]]
            took, found = timed(model.fit, values, parameters, exit_deg=angles, weights=weights)
            theirs.append(took)
            assert abs(found.chisqr / last.chi_square - 1.0) < 1e-3
    return ours, theirs


class StokesLiveFit(LiveFit):
    """Bluesky's LiveFit of a row of three values a point, timed."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.times_ms = []

    def update_fit(self):
        took, _ = timed(super().update_fit)
        self.times_ms.append(took)


def bluesky_updates(points, updates):
    """Milliseconds that Bluesky's LiveFit holds the scan up for, for each of the last points; it fits S0 alone."""
    exit_deg = np.linspace(0.0, 60.0, points)
    data = scan(IRON, exit_deg, 1)
    model = lmfit.Model(s0)
    guess = hints()
    # n and k do not follow from S0 alone: they are held, and the peer has two parameters less to find.
    guess["n"].vary = guess["k"].vary = False
    live = StokesLiveFit(model, "s0", {"exit_deg": "exit_deg"}, guess, update_every=None)
    live.start({"uid": "1", "time": 0.0})
    for place in range(points - updates):
        live.event(_event(place, exit_deg, data))
    live.update_every = 1
    for place in range(points - updates, points):
        live.event(_event(place, exit_deg, data))
    return live.times_ms


def _event(place, exit_deg, data):
    values = {"exit_deg": float(exit_deg[place]), "s0": float(data.values[place, 0])}
    return {"seq_num": place + 1, "data": values, "timestamps": {}, "time": 0.0, "uid": str(place), "descriptor": "1"}


def searches(count, genetic):
    """How many of random metals and dielectrics end in the best optimum known, and milliseconds of each search."""
    found, genetic_found, times, genetic_times = 0, 0, [], []
    for seed in range(count):
        random = np.random.default_rng(seed)
        family = FAMILY if seed % 2 == 0 else GLASSES
        values = {"sigma": float(np.exp(random.uniform(np.log(0.05), np.log(0.6))))}
        values |= {"n": random.uniform(0.2, 5.0), "k": random.uniform(0.8, 8.0)} if seed % 2 == 0 else {}
        values |= {} if seed % 2 == 0 else {"n": random.uniform(1.3, 2.6)}
        values |= {name: random.uniform(*span) for name, span in (("rho_s", (0.2, 1)), ("rho_d", (0.01, 0.5)))}
        data = scan(values | {"rho_dd": random.uniform(0.005, 0.2)}, np.arange(61.0), seed, family)
        took, result = timed(fit, data, family, seed=seed)
        times.append(took)
        best = [result.chi_square, fit(data, family, start=values).chi_square]
        if seed < genetic:
            took, evolved = timed(fit, data, family, seed=seed, search="genetic")
            genetic_times.append(took)
            best.append(evolved.chi_square)
            genetic_found += evolved.chi_square <= min(best) + 1e-3
        found += result.chi_square <= min(best) + 1e-3
    return found, times, genetic_found, genetic_times


def median_and_tail(times_ms):
    return f"median {np.median(times_ms):8.2f} ms, 95th percentile {np.quantile(times_ms, 0.95):8.2f} ms"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=200, help="random scenes for the search")
    parser.add_argument("--genetic", type=int, default=40, help="of these, how many the genetic search gets too")
    arguments = parser.parse_args()
    for points, updates in ((61, 40), (5000, 40)):
        ours, theirs = live_updates(points, updates)
        print(f"update at {points} points x 3 values, 6 parameters:   {median_and_tail(ours)}")
        print(f"  lmfit from the same start, same compiled model:  {median_and_tail(theirs)}")
        blocked = bluesky_updates(points, min(updates, 10))
        print(f"  Bluesky LiveFit, S0 alone and 4 parameters:      {median_and_tail(blocked)}; the scan waits")
        slower = (np.median(times) / np.median(ours) for times in (theirs, blocked))
        print("  lmfit / ours {:.1f}, LiveFit / ours {:.1f}".format(*slower))
    found, times, genetic_found, genetic_times = searches(arguments.scenes, arguments.genetic)
    print(f"search: best optimum in {found} of {arguments.scenes} random scenes,  {median_and_tail(times)}")
    print(f"  genetic: {genetic_found} of {len(genetic_times)},  {median_and_tail(genetic_times)}")


if __name__ == "__main__":
    main()
