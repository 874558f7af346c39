"""A scene pays for the effects that it names and for no other, and has the same readings each time."""

import sys
from collections import Counter
from pathlib import Path

import pytest

import sim_devices
from sim_devices.effects.known import IN_ORDER, name_of
from sim_devices.world import World

FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
PROJECT = Path(sim_devices.__file__).parent
EFFECTS = {
    part["effect"]: part
    for part in (
        {"effect": "encoder_noise", "axis": "source_arm", "stddev_deg": 0.01},
        {"effect": "encoder_step", "axis": "source_arm", "step_deg": 0.05},
        {"effect": "backlash", "axis": "source_arm", "play_deg": 0.05},
        {"effect": "zero_offset", "axis": "source_arm", "offset_deg": 0.1},
        {"effect": "flexure", "axis": "source_arm", "amplitude_deg": 0.1},
        {"effect": "polarized_lamp", "s2": 0.5},
        {"effect": "lamp_drift", "relative_per_hour": -0.01},
        {"effect": "lamp_walk", "relative_per_root_hour": 0.01},
        {"effect": "flicker", "relative_amplitude": 0.01, "frequency_hz": 0.3},
        {"effect": "source_cone", "half_angle_deg": 0.5},
        {"effect": "acceptance_cone"},
        {"effect": "reference_polarizer", "angle_deg": 30.0},
        {"effect": "stray_light", "power_w": 1e-10},
        {"effect": "slot_angle_errors", "errors_deg": {2: 0.3}},
        {"effect": "slot_transmissions", "relative": {2: 0.98}},
        {"effect": "extinction_ratio", "ratio": 1e4},
        {"effect": "wheel_wobble", "stddev_deg": 0.1},
        {"effect": "dark_current", "power_w": 2e-10},
        {"effect": "shot_noise"},
        {"effect": "nonlinearity", "relative_loss": 0.01, "at_power_w": 1e-6},
        {"effect": "read_noise", "power_w": 2e-11},
        {"effect": "saturation", "power_w": 1e-3},
        {"effect": "quantisation", "digits": 7},
    )
}
OF_THE_CLOCK = {"encoder_noise", "lamp_drift", "lamp_walk", "flicker"}
FREE_ONCE_BUILT = {"polarized_lamp", "source_cone", "acceptance_cone", "slot_angle_errors", "slot_transmissions"}


def calls(world):
    """How often each function of the project runs while arms move, are asked, and a slot is measured."""
    ran = Counter()

    def count(frame, event, _):
        if event == "call" and PROJECT in Path(frame.f_code.co_filename).parents:
            ran[Path(frame.f_code.co_filename).relative_to(PROJECT).as_posix(), frame.f_code.co_qualname] += 1

    sys.setprofile(count)
    try:
        world.axes["source_arm"].move(40.0, 0.0, **FAST)
        world.axes["detector_arm"].move(30.0, 0.0, **FAST)
        world.analyzer.wheel.turn(2, 0.0, slots=6, slot_s=0.5)
        world.axes["source_arm"].position_deg(50.0)
        world.measure_w(100.0, 0.3)
    finally:
        sys.setprofile(None)
    return ran


def of_effects(ran):
    return {place for place in ran if place[0].startswith("effects/") and place[0] != "effects/measurement.py"}


def test_every_effect_is_shown_here():
    assert list(EFFECTS) == [name_of(kind) for kind in IN_ORDER]


def test_a_scene_without_effects_runs_no_function_of_any(scene_with):
    world = World(scene_with())
    ran = calls(world)
    assert ran[("world.py", "World.measure_w")] == 1
    assert not of_effects(ran)


def test_without_effects_light_and_encoder_are_those_of_world_and_motor(scene_with):
    world = World(scene_with())
    for role, axis in world.axes.items():
        assert world.angle_deg[role] == axis.position_deg == axis.motor_deg
        assert axis.before_motion == []
    assert world.row == world.analyzer.row
    assert world.arriving_w.__self__ is world.signal_w.__self__ is world


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_adds_its_own_functions_and_no_others(scene_with, name):
    without, with_it = calls(World(scene_with())), calls(World(scene_with(effects=[EFFECTS[name]])))
    (kind,) = (kind for kind in IN_ORDER if name_of(kind) == name)
    own = kind.__module__.removeprefix("sim_devices.").replace(".", "/") + ".py"
    assert {file for file, _ in of_effects(with_it)} == (set() if name in FREE_ONCE_BUILT else {own})
    if name in FREE_ONCE_BUILT:
        assert with_it == without


@pytest.mark.parametrize("absent", EFFECTS)
def test_all_effects_but_one_run_all_functions_but_those_of_the_one(scene_with, monkeypatch, absent):
    def refuse(*_):
        raise AssertionError("an effect that the scene does not name was built")

    (kind,) = (kind for kind in IN_ORDER if name_of(kind) == absent)
    monkeypatch.setattr(kind, "install", refuse)
    ran = calls(World(scene_with(effects=[part for name, part in EFFECTS.items() if name != absent])))
    assert not any(function.startswith(f"{kind.__name__}.") for _, function in ran)


def scan_w(world, pace_s):
    """Readings in three slots at three angles, one every `pace_s`."""
    readings_w, time_s = [], 0.0
    for exit_deg in (10.0, 30.0, 20.0):
        world.axes["detector_arm"].move(exit_deg, time_s, **FAST)
        for slot in (2, 3, 1):
            world.analyzer.wheel.turn(slot, time_s, slots=6, slot_s=0.5)
            time_s += pace_s
            readings_w.append(world.measure_w(time_s, 0.3))
    return readings_w


def test_all_effects_together_give_the_same_readings_each_time(scene_with):
    one, again = (scan_w(World(scene_with(effects=list(EFFECTS.values()))), 4.0) for _ in range(2))
    assert one == again
    assert scan_w(World(scene_with(effects=list(EFFECTS.values()), seed=2)), 4.0) != one


def test_how_fast_a_scan_goes_changes_no_reading_unless_the_lamp_is_unsteady(scene_with):
    timeless = [part for name, part in EFFECTS.items() if name not in OF_THE_CLOCK]
    fast, slow = (scan_w(World(scene_with(effects=timeless)), pace_s) for pace_s in (4.0, 31.7))
    assert fast == slow
    for name in ("lamp_drift", "lamp_walk", "flicker"):
        fast, slow = (scan_w(World(scene_with(effects=[EFFECTS[name]])), pace_s) for pace_s in (4.0, 31.7))
        assert fast != slow
