"""No random moves on random rigs ever let parts of the simulated bench touch, and without the interlock they do."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml

from acquisition.engine import Bench
from drivers.interlock import Interlock
from goniometer.assembly import connected
from goniometer.bench import served_ports, simulate
from goniometer.errors import CollisionError, ConfigurationError, DeviceFaultError, LimitError
from goniometer.load_files import load_recipe
from goniometer.rig_file import Rig
from sim_devices.bench import Bench as SimulatedBench
from sim_devices.scene import Scene

ROOT = Path(__file__).parents[2]
RIG = yaml.safe_load((ROOT / "rigs" / "simulated.yaml").read_text(encoding="utf-8"))
SCENE = yaml.safe_load((ROOT / "scenes" / "iron_noise_free.yaml").read_text(encoding="utf-8"))
ARMS = ("source_arm", "detector_arm")


def random_rig(rng: np.random.Generator) -> tuple[Rig, Scene]:
    """A bench whose arms take some room, and a rig file that says so with a margin."""
    source_half, detector_half = rng.uniform(2, 12, 2)
    frame_deg = rng.uniform(75, 95)
    closest_deg = source_half + detector_half + rng.uniform(0.05, 3)
    document = yaml.safe_load(yaml.safe_dump(RIG))
    for arm in ARMS:
        axis = document["devices"]["arms"]["axes"][arm]
        axis |= {"limits_deg": [-120, 120], "velocity_deg_s": float(rng.uniform(3, 20))}
        axis |= {"backlash_deg": float(rng.choice([0.0, 1.5]))}
    document["collision_zones"] = [{"arms_closer_than_deg": float(closest_deg)}]
    for arm, half in zip(ARMS, (source_half, detector_half), strict=True):
        edge = float(frame_deg - half - 0.05)
        document["collision_zones"] += [{arm: [edge, 130.0]}, {arm: [-130.0, -edge]}]
    scene = SCENE | {
        "start_deg": {"source_arm": 40.0, "detector_arm": 20.0},
        "bodies": {
            "source_arm_half_deg": float(source_half),
            "detector_arm_half_deg": float(detector_half),
            "frame_deg": float(frame_deg),
        },
    }
    return Rig.model_validate(document), Scene.model_validate(scene)


@contextmanager
def bench_of(rig: Rig, scene: Scene) -> Iterator[tuple[SimulatedBench, Bench]]:
    with (
        simulate(scene, "max") as simulated,
        connected(rig, served_ports(rig, simulated), simulated.clock, 550) as bench,
    ):
        yield simulated, bench


def until_at_rest(simulated: SimulatedBench, bench: Bench) -> None:
    moving = list(bench.axes.values())
    while moving := [axis for axis in moving if axis.is_moving()]:
        simulated.clock.sleep(0.05)


def wander(rng: np.random.Generator, simulated: SimulatedBench, bench: Bench) -> dict[str, int]:
    """Send the axes about: in safe order, one while another moves, and stop them on the way."""
    done = {"arrived": 0, "refused": 0, "stopped": 0}
    for _ in range(12):
        roles = list(rng.permutation(["source_arm", "detector_arm", "sample_azimuth"])[: rng.integers(1, 4)])
        targets = {str(role): float(rng.uniform(-125, 125)) for role in roles}
        try:
            if rng.random() < 0.6:
                for together in bench.order(targets):
                    for role in together:
                        bench.axes[role].start_move(targets[role])
                    until_at_rest(simulated, bench)
                done["arrived"] += 1
            else:
                for role, target in targets.items():
                    bench.axes[role].start_move(target)
                    simulated.clock.sleep(rng.uniform(0, 1))
                if rng.random() < 0.5:
                    until_at_rest(simulated, bench)
        except (CollisionError, LimitError):
            done["refused"] += 1
        except DeviceFaultError as error:
            if "not ready" not in error.happened:  # the table's drive takes no move while it moves; the arms' does
                raise
            done["refused"] += 1
        if rng.random() < 0.7:
            assert not bench.stop(simulated.clock)
            done["stopped"] += 1
    assert not bench.stop(simulated.clock)
    return done


@pytest.mark.parametrize("seed", range(15))
def test_random_moves_never_touch(seed: int) -> None:
    rng = np.random.default_rng(seed)
    with bench_of(*random_rig(rng)) as (simulated, bench):
        done = wander(rng, simulated, bench)
    assert sum(done.values()) > 12  # and the end of the block has found no contact


@pytest.mark.parametrize("seed", range(15))
def test_without_the_interlock_they_do(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Interlock, "_permit", lambda *_: None)
    monkeypatch.setattr(Interlock, "order", lambda _, targets: (tuple(targets),))
    rng = np.random.default_rng(seed)
    with pytest.raises(DeviceFaultError, match="touched after"), bench_of(*random_rig(rng)) as (simulated, bench):
        wander(rng, simulated, bench)


def test_a_refused_move_sends_nothing_that_moves() -> None:
    rng = np.random.default_rng(1)
    with bench_of(*random_rig(rng)) as (simulated, bench):
        with pytest.raises(
            CollisionError, match=r"detector_arm: the way from 20 to -60 degrees enters a collision zone"
        ):
            bench.detector_arm.start_move(-60)
        simulated.clock.sleep(5.0)
        assert simulated.world.axes["detector_arm"].motor_deg(simulated.clock.now()) == 20.0


def test_a_recipe_whose_way_leads_through_a_zone_is_refused_before_anything_moves(tmp_path: Path) -> None:
    for folder in ("rigs", "scenes", "recipes"):
        (tmp_path / folder).mkdir()
    rig = RIG | {"collision_zones": [{"arms_closer_than_deg": 15.0}]}
    (tmp_path / "rigs" / "simulated.yaml").write_text(yaml.safe_dump(rig), encoding="utf-8")
    (tmp_path / "scenes" / "iron.yaml").write_text((ROOT / "scenes" / "iron.yaml").read_text(encoding="utf-8"))
    recipe = (ROOT / "recipes" / "iron_60deg.yaml").read_text(encoding="utf-8")
    path = tmp_path / "recipes" / "iron_60deg.yaml"
    path.write_text(recipe, encoding="utf-8")
    assert load_recipe(path)
    document = yaml.safe_load(recipe) | {"exit": {"start_deg": -80, "stop_deg": 60, "step_deg": 10}}
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"key 'exit': leads through a collision zone: from .* 60/-80/0 to "):
        load_recipe(path)
