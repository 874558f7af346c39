"""Ratios of times, each beside what the project has set itself."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from directions import DIRECTION_SETS
from interleaved import interleaved_s, ratio
from model_case import DIRECTIONS, Case, angles
from model_peers import INDEX

from model.acceptance import Acceptance
from model.bounce_bound import Tolerance
from model.lobes import Specular
from model.surface import Surface

FOLDER = Path(__file__).resolve().parent
ROUNDS, ROUNDS_FOR_ONE_PERCENT, PROCESSES = 21, 101, 5
# SCATMECH takes one direction a call: fewer tell as much.
PEER_DIRECTIONS = {"mitsuba": DIRECTIONS, "pyscatmech": DIRECTIONS // 10}
TOLERANCE, SMALL_SIGMA = 1e-4, 0.1
THREE_LOBES, SPECULAR = "three lobes", "specular alone"
ASYMMETRIC, MUELLER = {"asymmetry": 0.4}, {"light": "Mueller"}


class Finding(NamedTuple):
    """A figure and its target: at least or at most the limit."""

    what: str
    value: float
    limit: float
    at_least: bool = False
    unit: str = ""

    @property
    def verdict(self) -> str:
        is_met = self.value >= self.limit if self.at_least else self.value <= self.limit
        return f"{self.value:.3g}{self.unit} {'ok' if is_met else 'MISS'}"

    @property
    def bound(self) -> str:
        return f"{'≥' if self.at_least else '≤'} {self.limit:g}{self.unit}"


def report(peers: Path, cores: set[int]) -> None:
    for title, findings in (
        ("Speed beside peers, three lobes, one bounce, unpolarized column, one core", _beside_peers(peers)),
        ("Two cores", _two_cores(cores)),
        ("What is not asked for", _not_asked_for()),
        ("Fresh processes", _fresh_processes()),
    ):
        print(f"\n{title}\n\n| | found | target |\n|---|---|---|")
        for finding in findings:
            print(f"| {finding.what} | {finding.verdict} | {finding.bound} |", flush=True)
    _report_effects()
    _report_memory()


def _beside_peers(peers: Path) -> Iterator[Finding]:
    for where in ("random", "grid"):
        calls = {name: Case(where=where, precision=name).call() for name in ("float64", "float32")}
        times: dict[str, list[float]] = {name: [] for name in (*calls, *PEER_DIRECTIONS)}
        for _ in range(PROCESSES):
            for name, samples_s in interleaved_s(calls, ROUNDS).items():
                times[name].append(1e9 * float(np.median(samples_s)) / DIRECTIONS)
            for name in PEER_DIRECTIONS:
                times[name].append(_peer_ns(peers, name, where))
        told = ", ".join(f"{name} {statistics.median(rounds_ns):.3g}" for name, rounds_ns in times.items())
        print(f"| {where}, ns a direction: {told} | | |")
        for precision, peer, limit in (
            ("float64", "mitsuba", 0.5),
            ("float64", "pyscatmech", 100.0),
            ("float32", "mitsuba", 1.5),
        ):
            speeds = [theirs / ours for theirs, ours in zip(times[peer], times[precision], strict=True)]
            yield Finding(f"{where}, {precision} beside {peer}", statistics.median(speeds), limit, at_least=True)


def _peer_ns(peers: Path, name: str, where: str) -> float:
    count = str(PEER_DIRECTIONS[name])
    return float(_json(peers, "model_peers.py", name, "--set", where, "--directions", count)["ns_per_direction"])


def _two_cores(cores: set[int]) -> Iterator[Finding]:
    if len(cores) < 2:
        return
    for bounces in (1, 4):
        evaluate = Case(bounces=bounces).call()
        first, second = sorted(cores)[:2]
        sets = {"first": {first}, "second": {second}, "both": {first, second}}
        samples = interleaved_s(
            {name: partial(_on, used, evaluate) for name, used in sets.items()}, ROUNDS, time.perf_counter
        )
        os.sched_setaffinity(0, sets["first"])
        # What others leave of the second core is not the model's doing.
        what = f"speed of both beside one, K = {bounces} (second core alone: {ratio(samples, 'first', 'second'):.2f})"
        yield Finding(what, ratio(samples, "first", "both"), 1.6, at_least=True)


def _on(cores: set[int], evaluate: Callable[[], object]) -> None:
    os.sched_setaffinity(0, cores)  # kernels start as many threads as there are cores to use
    evaluate()


def _not_asked_for() -> Iterator[Finding]:
    chosen = Specular(1.0, SMALL_SIGMA, INDEX, bounces=Tolerance(TOLERANCE))
    calls = {
        bounces: partial(Surface([replace(chosen, bounces=bounces)]).stokes, *angles("random", "float64"))
        for bounces in (chosen.bounces, chosen.followed, 8)
    }
    samples = interleaved_s(calls, ROUNDS_FOR_ONE_PERCENT)
    tag = f"time at sigma {SMALL_SIGMA:g}, K by tolerance {TOLERANCE:g}, which is {chosen.followed},"
    yield Finding(f"{tag} / K = {chosen.followed} given", ratio(samples, chosen.bounces, chosen.followed), 1.02)
    yield Finding(f"{tag} / K = 8 given", ratio(samples, chosen.bounces, 8), 1.0)

    plain = Case(lobes="specular alone")
    alone, everything = plain.call(), Acceptance(Case(bounces=4, asymmetry=0.4).surface(), float(np.radians(0.5)))
    before = alone()
    everything.stokes(1.0, 0.5, 2.0)
    beside = plain.call()
    times = interleaved_s(
        {"alone": alone, "everything": partial(everything.stokes, 1.0, 0.5, 2.0), "beside": beside},
        ROUNDS_FOR_ONE_PERCENT,
    )
    yield Finding(
        "one lobe's time, made beside a scene of all effects / made before it", ratio(times, "beside", "alone"), 1.02
    )
    yield Finding("numbers of its result that differ", float((beside() != before).sum()), 0.0)


def _fresh_processes() -> Iterator[Finding]:
    with tempfile.TemporaryDirectory() as folder:
        kernels = [
            _fresh_process(folder, *scene)["compiled"]
            for scene in ((SPECULAR, 1, 0.0), (THREE_LOBES, 4, 0.4), (SPECULAR, 1, 0.0))
        ]
    yield Finding("kernels that the same lobe needs after a process with all effects", kernels[-1], 0.0)
    imports: list[dict[str, float]] = []
    for bounces, asymmetry in ((1, 0.0), (4, 0.0), (4, 0.4), (8, 0.4)):
        cold, warm = [], []
        for _ in range(PROCESSES):
            with tempfile.TemporaryDirectory() as folder:
                cold.append(_fresh_process(folder, THREE_LOBES, bounces, asymmetry))
                warm.append(_fresh_process(folder, THREE_LOBES, bounces, asymmetry))
        imports += cold + warm
        compiling_s = _median(cold, "first_call_s")
        what = f"first call, K = {bounces}, a = {asymmetry:g}, kept machine code (without: {compiling_s:.2f} s)"
        yield Finding(what, _median(warm, "first_call_s"), 0.5, unit=" s")
    what = f"import of the model, numpy's {_median(imports, 'numpy_s'):.2f} s included"
    yield Finding(what, _median(imports, "import_s"), 0.3, unit=" s")


def _report_memory() -> None:
    told = []
    with tempfile.TemporaryDirectory() as folder:
        for threshold in (str(2**25), str(2**17)):
            settings = {"MALLOC_MMAP_THRESHOLD_": threshold, "MALLOC_TRIM_THRESHOLD_": threshold}
            runs = [_fresh_process(folder, THREE_LOBES, 1, 0.0, **settings) for _ in range(PROCESSES)]
            told.append(_median(runs, "ns_per_direction"))
    print("\nThree lobes, K = 1, ns a direction: {:.1f} in kept memory, {:.1f} in memory mapped anew".format(*told))


def _fresh_process(folder: str, lobes: str, bounces: int, asymmetry: float, **settings: str) -> dict[str, float]:
    settings["GONIOMETER_CACHE_DIR"] = folder
    return _json(Path(sys.executable), "model_fresh_process.py", lobes, str(bounces), str(asymmetry), **settings)


def _json(python: Path, script: str, *arguments: str, **environment: str) -> dict[str, Any]:
    command = [str(python), str(FOLDER / script), *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, env={**os.environ, **environment})
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def _median(runs: list[dict[str, float]], key: str) -> float:
    return statistics.median(run[key] for run in runs)


def _report_effects() -> None:
    """What bounces, asymmetry and the whole matrix cost, for both surfaces and all sets of directions."""
    bases = [Case(where=where, lobes=lobes) for lobes in (THREE_LOBES, SPECULAR) for where in DIRECTION_SETS]
    cases = [base._replace(bounces=bounces) for base in bases for bounces in (1, 2, 4)]
    cases += [case._replace(**change) for change in (ASYMMETRIC, MUELLER) for case in cases]
    samples = interleaved_s({case: case.call() for case in cases}, ROUNDS)

    print("\nTimes of the model, one core, float64\n")
    print("| | target | " + " | ".join(f"{base.lobes}, {base.where}" for base in bases) + " |")
    print("|---|---|" + "---|" * len(bases))
    told = [f"{1e9 * float(np.median(samples[base])) / DIRECTIONS:.1f}" for base in bases]
    print(f"| K = 1, column, a = 0, ns a direction | | {' | '.join(told)} |")
    for bounces, limit in ((2, 4.0), (4, 12.0)):
        findings = [
            Finding("", ratio(samples, base._replace(bounces=bounces), base), limit / (1 + (base.where == "in plane")))
            for base in bases
        ]
        bound = f"≤ {limit:g}, in plane ≤ {limit / 2:g}"
        print(f"| K = {bounces} / K = 1 | {bound} | {' | '.join(finding.verdict for finding in findings)} |")
    for what, change in (("a = 0.4 / a = 0", ASYMMETRIC), ("Mueller / column", MUELLER)):
        for bounces in (1, 2, 4):
            cheaper = [base._replace(bounces=bounces) for base in bases]
            findings = [Finding("", ratio(samples, case._replace(**change), case), 2.5) for case in cheaper]
            print(f"| {what}, K = {bounces} | ≤ 2.5 | {' | '.join(finding.verdict for finding in findings)} |")
