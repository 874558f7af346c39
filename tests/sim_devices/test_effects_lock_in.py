"""Before a lock-in, each effect of lamp and detector changes X and Y as predicted on paper for chopped light."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim_devices.world import World

VOLTS_PER_WATT = 1e5
PHOTON_J = 6.62607015e-34 * 299792458 / 550e-9
# the detector's volts for each watt, for a square wave whose fundamental has VOLTS_PER_WATT of rms
DETECTOR_V_PER_W = VOLTS_PER_WATT * math.pi / math.sqrt(2)


@pytest.fixture
def lock_in(scene_with, scene_document, ask):
    """Ask a locked lock-in of a bench with some effects: 10 ms time constant, 12 dB, 100 mV full scale."""

    def ask_with(*effects, setting=b""):
        detector = {"type": "stanford_sr830", "acceptance_sr": 1e-3, "volts_per_watt": VOLTS_PER_WATT}
        world = World(scene_with(devices=scene_document["devices"] | {"meter": detector}, effects=effects))
        session = world.devices["meter"].session()
        ask(session, b"FMOD 0;SENS 23;OFLT 6;OFSL 1;" + setting + b"\r", 1.0)
        ask(session, b"*CLS\r", 5.0)

        def numbers(command, time_s=100.0):
            return np.array([float(text) for text in ask(session, command + b"\r", time_s).split(b",")])

        return numbers

    return ask_with


@pytest.fixture
def clear_w(scene_with):
    return World(scene_with()).power_w(100.0)


def test_without_effects_x_is_the_light_in_volts(lock_in, clear_w):
    assert_allclose(lock_in()(b"SNAP? 1,2"), [VOLTS_PER_WATT * clear_w, 0.0], rtol=1e-5)


@pytest.mark.parametrize("effect", ["dark_current", "stray_light"])
def test_what_is_not_chopped_shifts_the_level_and_not_the_reading(lock_in, clear_w, effect):
    asked = lock_in({"effect": effect, "power_w": 3 * clear_w})
    assert_allclose(asked(b"SNAP? 1,2"), [VOLTS_PER_WATT * clear_w, 0.0], rtol=1e-5)
    assert_allclose(asked(b"OAUX? 1"), DETECTOR_V_PER_W * 3.5 * clear_w, atol=2e-4)


def spreads_v(asked):
    """Standard deviations of X and Y, at times that share no noise."""
    return np.array([asked(b"SNAP? 1,2", 100.0 + 0.045 * number) for number in range(800)]).std(axis=0)


@pytest.mark.parametrize("dark_per_light", [0.0, 4.0])
def test_shot_noise_is_that_of_the_mean_current_in_the_filters_bandwidth(lock_in, clear_w, dark_per_light):
    dark = [{"effect": "dark_current", "power_w": dark_per_light * clear_w}] * bool(dark_per_light)
    # half of the time the light is there, and all of the time the dark current: density sqrt(2 h nu P)
    density_w = math.sqrt(2 * PHOTON_J * (0.5 + dark_per_light) * clear_w)
    spread_v = DETECTOR_V_PER_W * density_w * math.sqrt(1 / (8 * 0.01))
    assert_allclose(spreads_v(lock_in({"effect": "shot_noise"}, *dark)), spread_v, rtol=0.09)


def test_read_noise_is_white_in_the_filters_bandwidth(lock_in, clear_w):
    # s in 3 ms is a density of s sqrt(2 . 3 ms)
    spread_v = DETECTOR_V_PER_W * 0.01 * clear_w * math.sqrt(0.006) * math.sqrt(1 / (8 * 0.01))
    assert_allclose(spreads_v(lock_in({"effect": "read_noise", "power_w": 0.01 * clear_w})), spread_v, rtol=0.09)


@pytest.mark.parametrize("dark_per_light", [0.0, 2.0])
def test_a_nonlinear_detector_shows_the_difference_of_its_two_levels(lock_in, clear_w, dark_per_light):
    dark = [{"effect": "dark_current", "power_w": dark_per_light * clear_w}] * bool(dark_per_light)
    steep = {"effect": "nonlinearity", "relative_loss": 0.2, "at_power_w": clear_w}

    def told(share):
        return share / (1 + share * (1 / 0.8 - 1))

    swing = told(1 + dark_per_light) - told(dark_per_light)
    assert_allclose(lock_in(steep, *dark)(b"OUTP? 1"), VOLTS_PER_WATT * clear_w * swing, rtol=1e-5)


@pytest.mark.parametrize(("limit_per_light", "dark_per_light"), [(0.9, 0.0), (1.5, 0.6)])
def test_a_detector_that_saturates_overloads_the_input(lock_in, clear_w, limit_per_light, dark_per_light):
    dark = [{"effect": "dark_current", "power_w": dark_per_light * clear_w}] * bool(dark_per_light)
    assert lock_in(*dark)(b"LIAS?") == 0
    saturated = lock_in(*dark, {"effect": "saturation", "power_w": limit_per_light * clear_w})
    assert int(saturated(b"LIAS?")[0]) & 1
    assert lock_in(*dark, {"effect": "saturation", "power_w": 2 * clear_w})(b"LIAS?") == 0


@pytest.mark.parametrize("frequency_hz", [2.0, 20.0, 60.0])
def test_a_lamp_that_flickers_is_followed_as_far_as_the_filter_follows(lock_in, clear_w, frequency_hz):
    asked = lock_in({"effect": "flicker", "relative_amplitude": 0.3, "frequency_hz": frequency_hz})
    times_s = 100.0 + 0.0371 * np.arange(400)
    shares = np.array([asked(b"OUTP? 1", time_s)[0] for time_s in times_s]) / (VOLTS_PER_WATT * clear_w)
    amplitude = 0.3 / (1 + (2 * math.pi * frequency_hz * 0.01) ** 2)
    assert_allclose(shares.std() * math.sqrt(2), amplitude, rtol=0.06)
    assert_allclose(shares.mean(), 1.0, atol=0.02)


def test_a_lamp_that_drifts_is_followed(lock_in, clear_w):
    asked = lock_in({"effect": "lamp_drift", "relative_per_hour": -0.5})
    assert_allclose(asked(b"OUTP? 1", 3600.0), VOLTS_PER_WATT * clear_w * math.exp(-0.5), rtol=1e-4)
