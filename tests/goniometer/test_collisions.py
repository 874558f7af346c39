"""No random moves on random rigs ever let parts of the simulated bench touch, and without the interlock they do."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml

import goniometer
from acquisition.engine import Bench
from acquisition.expand import Step, Target
from acquisition.placement import Placement
from drivers.interlock import Interlock
from goniometer.assembly import connected
from goniometer.bench import served_ports, simulate
from goniometer.bench_commands.align import align
from goniometer.bench_commands.home import home
from goniometer.bench_commands.move import move
from goniometer.bench_commands.read import read
from goniometer.collision_zones import blocked_ways
from goniometer.errors import CollisionError, ConfigurationError, DeviceFaultError, LimitError
from goniometer.load_files import load_recipe, load_rig, load_scene
from goniometer.rig_file import Rig
from sim_devices.bench import Bench as SimulatedBench
from sim_devices.scene import Scene
from sim_devices.serving.control import ControlServer

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
        # to brake from full speed takes 0.06 to 20 degrees: often more than the margin
        axis |= {"velocity_deg_s": float(rng.uniform(3, 20)), "acceleration_deg_s2": float(rng.choice([80, 10]))}
        axis |= {"limits_deg": [-120, 120], "backlash_deg": float(rng.choice([0.0, 1.5]))}
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
    """Send the axes about: in safe order, one while another moves or brakes, and stop all of them on the way."""
    done = {"arrived": 0, "refused": 0, "stopped": 0}
    for _ in range(40):
        roles = list(rng.permutation(["source_arm", "detector_arm", "sample_azimuth"])[: rng.integers(1, 4)])
        targets = {str(role): float(rng.uniform(-125, 125)) for role in roles}
        if rng.random() < 0.7:
            targets = {role: bench.axes[role].position_deg() + float(rng.uniform(-40, 40)) for role in targets}
        try:
            if rng.random() < 0.4:
                standing = {role: axis.position_deg() for role, axis in bench.axes.items()}
                for together in bench.order(standing, targets):
                    for role in together:
                        bench.axes[role].start_move(targets[role])
                    until_at_rest(simulated, bench)
                done["arrived"] += 1
            else:
                for role, target in targets.items():
                    bench.axes[role].start_move(target)
                    simulated.clock.sleep(rng.uniform(0, 1))
                    if rng.random() < 0.2:
                        bench.axes[role].stop()
                if rng.random() < 0.8:
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
    assert min(done.values()) > 0  # and the end of the block has found no contact


@pytest.mark.parametrize("seed", range(15))
def test_without_the_interlock_they_do(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Interlock, "_permit", lambda *_: None)
    monkeypatch.setattr(Interlock, "order", lambda _, standing, targets: (tuple(targets),))
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


def test_a_bench_that_stands_in_a_zone_is_told_so() -> None:
    rig = Rig.model_validate(RIG | {"collision_zones": [{"arms_closer_than_deg": 70.0}]})
    scene = Scene.model_validate(SCENE | {"start_deg": {"source_arm": 40.0, "detector_arm": 20.0}})
    stands = r"the axes stand in a collision zone, at source_arm 40, detector_arm 20, .*start_deg in its scene"
    with bench_of(rig, scene) as (_, bench):
        standing = {role: axis.position_deg() for role, axis in bench.axes.items()}
        with pytest.raises(CollisionError, match=stands):
            bench.order(standing, {"detector_arm": 60.0})


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


Serve = Callable[[str], tuple[SimulatedBench, Path]]


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Serve]:
    """Serves a shipped scene as `goniometer simulate` does; gives the bench, and the rig file that reaches it."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))  # no locks of a real bench
    with ExitStack() as stack:

        def serve(scene: str) -> tuple[SimulatedBench, Path]:
            loaded = load_scene(ROOT / "scenes" / f"{scene}.yaml")
            simulated = stack.enter_context(simulate(loaded.scene, "max"))
            control = ControlServer(simulated, loaded.scene_text)
            stack.callback(control.stop)
            document = yaml.safe_load(loaded.rig_text) | {"bench": control.address}
            for name, port in served_ports(loaded.rig, simulated).items():
                document["devices"][name]["port"] = port
            path = tmp_path / "bench.yaml"
            path.write_text(yaml.safe_dump(document), encoding="utf-8")
            return simulated, path

        yield serve


def leave_moving(simulated: SimulatedBench, rig_path: Path, role: str) -> None:
    """What a program that is killed leaves behind: an axis on its way, and nobody who watches it."""
    rig = load_rig(rig_path)
    with connected(rig, {name: device.port for name, device in rig.devices.items()}, simulated.clock, None) as bench:
        axis = bench.axes[role]
        if not axis.is_homed():
            axis.start_homing()
            until_at_rest(simulated, bench)
        axis.start_move(60.0)


def quiet(_: str) -> None: ...


COMMANDS = {
    "move": lambda rig, role, scene: move(rig, role, 10.0, quiet, quiet),
    "home": lambda rig, role, scene: home(rig, [role], quiet, quiet, way_is_clear=False),
    "home, way is clear": lambda rig, role, scene: home(rig, [role], quiet, quiet, way_is_clear=True),
    "read": lambda rig, role, scene: read(rig, 0.1, None, 1, quiet),
    "align": lambda rig, role, scene: align(rig, "detector_arm", -3.0, 3.0, None, quiet, store=False),
    "run": lambda rig, role, scene: goniometer.run(RECIPES[scene], rig_path=rig, out=rig.parent / "runs"),
}
RECIPES = {
    "iron": ROOT / "recipes" / "iron_60deg.yaml",
    "iron_thorlabs": ROOT / "recipes" / "iron_thorlabs.yaml",
    "iron_lock_in": ROOT / "recipes" / "iron_lock_in.yaml",
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("scene", "role"),
    [
        ("iron", "source_arm"),
        ("iron", "sample_azimuth"),
        ("iron_thorlabs", "sample_azimuth"),
        ("iron_lock_in", "source_arm"),
    ],
    ids=["ESP301", "AZ", "LEC", "APT"],
)
def test_nothing_is_begun_on_a_bench_that_moves_and_nothing_stopped(
    served: Serve, scene: str, role: str, command: str
) -> None:
    simulated, rig_path = served(scene)
    leave_moving(simulated, rig_path, role)
    with pytest.raises(DeviceFaultError, match=rf"{role}: .* not told it to: .* not stopped\..* goniometer stop"):
        COMMANDS[command](rig_path, role, scene)
    axis = simulated.world.axes[role]
    assert axis.is_moving(simulated.clock.now())
    simulated.clock.sleep(10.0)
    assert axis.motor_deg(simulated.clock.now()) == pytest.approx(60.0, abs=0.03)


def test_after_a_program_was_killed_no_arm_is_sent_into_the_other_one() -> None:
    rig = Rig.model_validate(RIG | {"collision_zones": [{"arms_closer_than_deg": 15.0}]})
    bodies = {"source_arm_half_deg": 7.0, "detector_arm_half_deg": 7.0, "frame_deg": 100.0}
    scene = SCENE | {"start_deg": {"source_arm": 60.0, "detector_arm": 60.0}, "bodies": bodies}
    with simulate(Scene.model_validate(scene), "max") as simulated:

        def again() -> AbstractContextManager[Bench]:
            return connected(rig, served_ports(rig, simulated), simulated.clock, 550)

        with again() as bench:
            bench.detector_arm.start_move(-40.0)
        with pytest.raises(DeviceFaultError, match="detector_arm: the axis moves although"), again():
            pass
        simulated.clock.sleep(10.0)
        with again() as bench, pytest.raises(CollisionError, match="source_arm: the way from 60 to 20 degrees enters"):
            bench.source_arm.start_move(20.0)


def a_scan(rng: np.random.Generator) -> tuple[Rig, tuple[Step, ...]]:
    """A rig with play in its gears, and a scan that goes close to a few collision zones."""
    incidence_deg = float(rng.uniform(20, 60))
    exits_deg = rng.permutation(rng.uniform(-30, 60, 5)) if rng.random() < 0.5 else np.linspace(-25, 50, 5)
    document = yaml.safe_load(yaml.safe_dump(RIG))
    for arm in ARMS:
        document["devices"]["arms"]["axes"][arm] |= {"backlash_deg": float(rng.choice([0, 2, 8]))}
    document["devices"]["arms"]["axes"]["detector_arm"]["limits_deg"] = [-80, 85]
    document["collision_zones"] = [
        {"arms_closer_than_deg": float(incidence_deg - 30 + rng.uniform(-5, 8))} if incidence_deg > 38 else {},
        {"detector_arm": [-80.0, float(min(exits_deg) - rng.uniform(0, 8))]},
        {"detector_arm": [float(max(exits_deg) + rng.uniform(0, 8)), 85.0], "source_arm": [0.0, 90.0]},
        {
            "detector_arm": [float(min(exits_deg[1:3]) - 1), float(max(exits_deg[1:3]) + 1)],
            "source_arm": [0.0, float(incidence_deg + rng.uniform(-4, 1))],
        },
    ]
    document["collision_zones"] = [zone for zone in document["collision_zones"] if zone and rng.random() < 0.6]
    targets = [Target(incidence_deg, float(exit_deg), 0.0, 1) for exit_deg in exits_deg]
    return Rig.model_validate(document), tuple(Step(n, "signal", t, 0.0, 1, 0.1, 1.0) for n, t in enumerate(targets))


def runs_through(rig: Rig, steps: tuple[Step, ...]) -> bool:
    """Whether a bench that comes from a little above the first place gets to the last one."""
    first = steps[0].target
    start_deg = {"source_arm": first.incidence_deg + 0.02, "detector_arm": first.exit_deg + 0.02}
    with bench_of(rig, Scene.model_validate(SCENE | {"start_deg": start_deg})) as (simulated, bench):
        placement = Placement(bench, simulated.clock, simulated.clock.sleep)
        try:
            for step in steps:
                placement.arrive(step.target)
                placement.read_back(anew=True)
        except CollisionError:
            return False
        return True


def test_a_scan_is_found_free_exactly_when_it_runs_without_a_collision() -> None:
    rng = np.random.default_rng(11)
    found = {True: 0, False: 0}
    for _ in range(60):
        rig, steps = a_scan(rng)
        travels = {role: axis.travel for role, axis in rig.axes().items()}
        is_free = not list(blocked_ways(steps, rig.zones, travels))
        found[is_free] += 1
        assert runs_through(rig, steps) == is_free
    assert min(found.values()) > 15


def test_a_scan_that_stops_at_the_very_edge_of_a_zone_is_refused_beforehand() -> None:
    """It would end halfway, at the first arm that stops a little farther than it should."""
    rig = Rig.model_validate(RIG | {"collision_zones": [{"arms_closer_than_deg": 15.0}]})
    travels = {role: axis.travel for role, axis in rig.axes().items()}

    def scan_from(exit_deg: float) -> tuple[Step, ...]:
        targets = [Target(60.0, exit_deg, 0.0, 1), Target(60.0, 60.0, 0.0, 1)]
        return tuple(Step(n, "signal", target, 0.0, 1, 0.1, 1.0) for n, target in enumerate(targets))

    at_once = scan_from(-45.0)
    assert next(blocked_ways(at_once, rig.zones, travels)) == (at_once[0].target, at_once[0].target)
    later = scan_from(-44.98) + scan_from(-45.0)
    assert list(blocked_ways(later, rig.zones, travels)) == [(later[1].target, later[2].target)]
    assert not list(blocked_ways(scan_from(-44.98), rig.zones, travels))


def test_every_way_of_a_scan_that_is_blocked_is_found_whatever_lies_between() -> None:
    """Once each, where sweeps take them forth and back; stretches are looked at as a whole only where all is free."""
    rng = np.random.default_rng(12)
    found = 0
    for _ in range(40):
        rig, steps = a_scan(rng)
        there_and_back = (*steps, *steps[::-1], *steps)
        each: set[frozenset[Target]] = set()
        for number, (one, other) in enumerate(itertools.pairwise([steps[0], *there_and_back])):
            travels = {role: axis.travel for role, axis in rig.axes().items()}
            alone = (one, other) if number else (other,)
            ways = list(blocked_ways(alone, rig.zones, travels))
            is_way = number == 0 or one.target != other.target
            each |= {frozenset(way) for way in ways if is_way and way == (one.target, other.target)}
        ways = list(blocked_ways(there_and_back, rig.zones, travels))
        assert {frozenset(way) for way in ways} == each
        assert len(ways) == len(each)
        found += len(each)
    assert found > 40
