"""Connecting drivers to a bench and letting them go."""

from pathlib import Path

import pytest

from acquisition.engine import Engine, stopped_afterwards
from goniometer.assembly import connected
from goniometer.bench import served_ports, simulate
from goniometer.errors import ScanInterrupted
from goniometer.load_files import load_scene

ROOT = Path(__file__).resolve().parents[2]


def test_clients_come_and_go_while_another_thread_serves_the_bench():
    """A sleeper serves the bench too, and must not take the call that was meant for the bench's own thread."""
    setup = load_scene(ROOT / "scenes" / "iron.yaml")
    with simulate(setup.scene, "max") as bench:
        for _ in range(500):
            with connected(setup.rig, served_ports(setup.rig, bench), bench.clock, 550.0) as devices:
                assert devices.analyzer.slot() == 1
                bench.clock.sleep(0.001)


def test_connecting_moves_nothing():
    setup = load_scene(ROOT / "scenes" / "iron.yaml")
    with (
        simulate(setup.scene, "max") as bench,
        connected(setup.rig, served_ports(setup.rig, bench), bench.clock, 550.0) as devices,
    ):
        for _ in range(10):
            bench.clock.sleep(0.1)
            axes = (devices.source_arm, devices.detector_arm, devices.sample_azimuth)
            assert [axis.position_deg() for axis in axes] == [0.0, 0.0, 0.0]
            assert not any(axis.is_moving() for axis in axes)
            assert devices.analyzer.slot() == 1


def test_a_rotating_analyzer_comes_with_the_axis_that_turns_it():
    setup = load_scene(ROOT / "scenes" / "iron_thorlabs.yaml")
    with (
        simulate(setup.scene, "max") as bench,
        connected(setup.rig, served_ports(setup.rig, bench), bench.clock, 550.0) as devices,
    ):
        assert [axis.name for axis in devices.to_home] == ["source_arm", "detector_arm", "sample_azimuth", "polarizer"]
        assert devices.polarizer is devices.to_home[-1]
        assert devices.notes == ()


def test_homing_that_is_interrupted_leaves_nothing_moving():
    setup = load_scene(ROOT / "scenes" / "iron_thorlabs.yaml")
    checks = []

    def interrupt():
        checks.append(None)
        if len(checks) > 40:
            raise ScanInterrupted("a test", 130)

    with (
        simulate(setup.scene, "max") as bench,
        connected(setup.rig, served_ports(setup.rig, bench), bench.clock, 550.0) as devices,
    ):
        engine = Engine(devices, bench.clock, None, lambda event: None, interrupt, 0.0)
        with pytest.raises(ScanInterrupted), stopped_afterwards(devices, bench.clock):
            engine.home()
        assert bench.world.axes["source_arm"].motor_deg(bench.clock.now()) < 7.0
        assert not any(axis.is_moving(bench.clock.now()) for axis in bench.world.axes.values())
