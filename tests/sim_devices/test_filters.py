"""Filters in the simulated bench: which light there is, what it does to sample and noise, byte for byte a wheel."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from pydantic import ValidationError

from model import materials
from model.geometry import in_plane
from sim_devices.scene import Scene
from sim_devices.world import World, surface

ROOT = Path(__file__).resolve().parents[2]


def scene(**changes):
    content = yaml.safe_load((ROOT / "scenes" / "iron_filters.yaml").read_text())
    return Scene.model_validate(
        content | {"effects": [], "start_deg": {"source_arm": 60, "detector_arm": 50}} | changes
    )


def turned(world, slot, now_s):
    return world.filters.wheel.turn(slot, now_s, slots=6, slot_s=0.5)


def test_the_light_is_that_of_the_filter_in_the_beam():
    world = World(scene())
    now_s = 0.0
    for slot, wavelength_nm, transmission in ((1, 525.0, 0.8), (3, 580.0, 0.9), (2, 550.0, 1.0)):
        now_s = turned(world, slot, now_s) + 1.0
        assert world.wavelength_nm(now_s) == wavelength_nm
        there = (float(angle) for angle in in_plane(np.radians(50.0)))
        stokes = surface(world.scene, wavelength_nm).stokes(np.radians(60.0), *there, world.lamp_stokes)
        expected_w = transmission * 1e-4 * 1e-4 * np.cos(np.radians(50.0)) * stokes[0]
        assert_allclose(world.power_w(now_s), expected_w, rtol=1e-12)
        assert surface(world.scene, wavelength_nm).lobes[0].index == materials.index("Fe", wavelength_nm)


def test_while_the_wheel_turns_and_behind_a_slot_without_a_filter_it_is_dark():
    world = World(scene())
    arrival_s = turned(world, 3, 1.0)
    assert arrival_s == 2.0
    assert world.power_w(0.9) > 0.0
    assert world.power_w(1.5) == 0.0
    assert world.power_w(2.0) > 0.0
    assert world.power_w(turned(world, 5, 3.0) + 1.0) == 0.0


def test_photons_are_those_of_the_filter():
    """Their number has the variance of its mean: the variance of the power goes as the photons' energy."""
    noise = {}
    for slot, wavelength_nm in ((1, 525.0), (3, 580.0)):
        world = World(scene(effects=[{"effect": "shot_noise"}], lamp={"power_w": 1e-6}))
        start_s = turned(world, slot, 0.0) + 1.0
        powers_w = np.array([world.measure_w(start_s + number, 0.001) for number in range(4000)])
        noise[wavelength_nm] = powers_w.var() / powers_w.mean() * 0.001
    for wavelength_nm, photon_j in noise.items():
        assert_allclose(photon_j, 6.62607015e-34 * 299792458.0 / (wavelength_nm * 1e-9), rtol=0.1)


def test_a_wheel_of_filters_answers_as_the_analyzer_s_does():
    session = World(scene()).devices["filters"].session()
    said = b"".join(part for _, part in session.receive(b"pos?\rpcount?\r", 0.0) if isinstance(part, bytes))
    assert said == b"pos?\r1\r> pcount?\r6\r> "


def test_an_index_that_is_written_is_the_same_at_all_wavelengths():
    grey = scene(sample={"index": {"n": 1.5, "k": 0.1}, "sigma": 0.2, "rho_s": 1, "rho_d": 0, "rho_dd": 0})
    assert grey.wavelengths_nm() == (525.0, 550.0, 580.0)
    assert {grey.truth(wavelength_nm)["k"] for wavelength_nm in grey.wavelengths_nm()} == {0.1}
    iron = scene()
    assert iron.truth(580.0)["k"] == materials.index("Fe", 580.0).imag != iron.truth(525.0)["k"]


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"lamp": {"power_w": 1e-4, "wavelength_nm": 550}}, "leave the lamp's wavelength_nm out"),
        ({"sample": {"material": "PTFE", "sigma": 0.2, "rho_s": 1, "rho_d": 0, "rho_dd": 0}}, "525 nm is outside"),
    ],
)
def test_scenes_that_contradict_themselves_are_refused(changes, what):
    with pytest.raises(ValidationError, match=what):
        scene(**changes)


def test_a_lamp_without_filters_needs_a_wavelength():
    content = yaml.safe_load((ROOT / "scenes" / "iron.yaml").read_text()) | {"lamp": {"power_w": 1e-4}}
    with pytest.raises(ValidationError, match="no wavelength_nm, and no filters choose one"):
        Scene.model_validate(content)


def test_a_filter_in_a_slot_that_the_wheel_has_not_is_refused():
    content = yaml.safe_load((ROOT / "scenes" / "iron_filters.yaml").read_text())
    content["devices"]["filters"]["filters"][9] = {"wavelength_nm": 530}
    with pytest.raises(ValidationError, match="slot 9 has a filter, and the wheel has 6 slots"):
        Scene.model_validate(content)
