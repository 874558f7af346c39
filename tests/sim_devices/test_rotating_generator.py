"""Light behind a generator is what Mueller matrices say, and the world shows the sample that light."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from model.mueller import polarizer, retarder
from sim_devices.generator import RotatingGenerator
from sim_devices.scene import Scene
from sim_devices.world import World, surface

ROOT = Path(__file__).resolve().parents[2]
ANGLE = st.floats(-180, 180)
FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
LAMP = np.array([1.0, 0.2, -0.3, 0.4])


@given(ANGLE, ANGLE, st.floats(1, 359))
def test_the_light_has_passed_the_polarizer_and_then_the_retarder(polarizer_deg, retarder_deg, retardance_deg):
    generator = RotatingGenerator(lambda _: polarizer_deg, lambda _: retarder_deg, retardance_deg)
    plate = retarder(math.radians(retardance_deg), math.radians(retarder_deg))
    expected = 2.0 * plate @ polarizer(math.radians(polarizer_deg)) @ LAMP
    assert_allclose(generator.stokes(0.0, LAMP), expected, atol=1e-12)


def test_a_polarizer_alone_is_where_it_is_at_the_time():
    generator = RotatingGenerator(lambda time_s: 10.0 * time_s)
    assert_allclose(generator.stokes(4.5, np.array([1.0, 0, 0, 0])), [1, 0, 1, 0], atol=1e-15)
    assert_allclose(generator.stokes(9.0, np.array([1.0, 0, 0, 0])), [1, -1, 0, 0], atol=1e-15)


def test_a_plate_at_0_makes_light_at_45_degrees_turn_anticlockwise():
    """The plate's slow axis, p, comes a quarter behind: (1, exp(i pi/2)) = (1, i), of S3 = 2 Im(Ex Ey*) = -2."""
    generator = RotatingGenerator(lambda _: 45.0, lambda _: 0.0)
    assert_allclose(generator.stokes(0.0, np.array([1.0, 0, 0, 0])), [1, 0, 0, -1], atol=1e-15)


@pytest.fixture
def world():
    content = yaml.safe_load((ROOT / "scenes" / "iron_mueller.yaml").read_text(encoding="utf-8"))
    return World(Scene.model_validate(content | {"effects": []}))


def test_the_power_is_row_times_sample_times_light(world):
    places = {"source_arm": 50.0, "detector_arm": 35.0, "generator_retarder": 25.0, "retarder": -40.0}
    for role, angle_deg in places.items():
        world.axes[role].move(angle_deg, 0.0, **FAST)
    light_deg, seen_deg = (world.axes[role].target_deg for role in ("generator_retarder", "retarder"))
    mueller = surface(world.scene).mueller(math.radians(50), math.radians(35), math.pi)
    quarter = math.pi / 2
    light = 2.0 * retarder(quarter, math.radians(light_deg)) @ polarizer(0.0) @ [1, 0, 0, 0]
    row = (polarizer(0.0) @ retarder(quarter, math.radians(seen_deg)))[0]
    expected = 1e-4 * 1e-4 * math.cos(math.radians(35)) * (row @ mueller @ light)
    assert_allclose(world.power_w(1e4), expected, rtol=1e-9)
