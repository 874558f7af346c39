"""What each effect of a simulated bench costs: time of a reading with it over the time without, all in one run.

The figures in docs/simulated_bench.md come from here: ``python benchmarks/effects.py``. A scene that does not name an
effect runs the bare bench, which is measured a second time among the others: its ratio tells what 1.00 is worth.
"""

import math
import statistics
from itertools import count
from pathlib import Path

from interleaved import interleaved_s, ratio

from goniometer.load_files import load_scene
from sim_devices.scene import Scene
from sim_devices.world import World

SCENE = Path(__file__).resolve().parent.parent / "scenes" / "iron_noise_free.yaml"
ROUNDS = 41
EXPOSURE_S = 0.3
EFFECTS = (
    {"effect": "encoder_noise", "axis": "detector_arm", "stddev_deg": 0.001},
    {"effect": "encoder_step", "axis": "detector_arm", "step_deg": 0.01},
    {"effect": "backlash", "axis": "detector_arm", "play_deg": 0.05},
    {"effect": "zero_offset", "axis": "detector_arm", "offset_deg": 0.1},
    {"effect": "flexure", "axis": "detector_arm", "amplitude_deg": 0.1},
    {"effect": "polarized_lamp", "s2": 0.5},
    {"effect": "lamp_drift", "relative_per_hour": -0.01},
    {"effect": "lamp_walk", "relative_per_root_hour": 0.01},
    {"effect": "flicker", "relative_amplitude": 0.01, "frequency_hz": 100.0},
    {"effect": "source_cone", "half_angle_deg": 0.3},
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
FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}


def world_with(document, *effects):
    world = World(Scene.model_validate(document | {"effects": effects}))
    world.axes["source_arm"].move(60.0, 0.0, **FAST)
    world.analyzer.wheel.turn(2, 0.0, slots=6, slot_s=0.5)
    return world


def at_rest(world):
    """A reading where the bench has been read before."""
    return lambda: world.measure_w(100.0, EXPOSURE_S)


def on_the_way(world):
    """A reading at an angle of its own, as each point of a scan begins: the sample is computed anew."""
    arm, turn = world.axes["detector_arm"], count()

    def read():
        time_s = 100.0 + next(turn)
        arm.move(45.0 + 10.0 * math.sin(time_s), time_s, **FAST)
        world.measure_w(time_s + 0.5, EXPOSURE_S)

    return read


def asked(world):
    """What a controller asks its axis."""
    arm = world.axes["detector_arm"]
    return lambda: arm.position_deg(100.0)


def main():
    document = load_scene(SCENE).scene.model_dump(exclude={"effects"})
    cases = {"none": (), "none again": (), **{effect["effect"]: (effect,) for effect in EFFECTS}}
    cases["all"] = EFFECTS
    worlds = {name: world_with(document, *effects) for name, effects in cases.items()}
    measured = {
        kind.__name__: interleaved_s({name: kind(world) for name, world in worlds.items()}, ROUNDS)
        for kind in (at_rest, on_the_way, asked)
    }
    for kind, samples in measured.items():
        print(f"without effects, {kind}: {1e6 * statistics.median(samples['none']):.2f} µs")
    print(f"{'effect':20}" + "".join(f"{kind:>12}" for kind in measured))
    for name in list(worlds)[1:]:
        print(f"{name:20}" + "".join(f"{ratio(samples, name, 'none'):12.2f}" for samples in measured.values()))


if __name__ == "__main__":
    main()
