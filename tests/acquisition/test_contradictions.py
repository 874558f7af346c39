"""A lamp that was off for a moment shows in the readings themselves; noise, peaks and a poor analyzer do not."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.contradictions import unsteady
from acquisition.readings import Reading
from acquisition.reduce import NoiseModel, Radiometry, Reduction

BEAM_W, ACCEPTANCE_SR, DARK_W = 1e-4, 1e-4, 2e-10
NOISE = NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=550)
ANGLES_DEG = (0.0, 45.0, 90.0, 135.0)
REPEATS, EXPOSURE_S = 3, 0.03
SIGNALS = len(ANGLES_DEG) * REPEATS


def direction(point, stokes, transmissions=(1.0, 1.0, 1.0, 1.0), noise=None, angles_deg=ANGLES_DEG):
    """The readings of a direction: three through each polarizer, and three of the dark."""
    exit_deg = float(point)
    arriving_w = BEAM_W * ACCEPTANCE_SR * np.cos(np.radians(exit_deg))
    s0, s1, s2 = stokes
    signals = [
        DARK_W + arriving_w * part * (s0 + s1 * np.cos(2 * psi) + s2 * np.sin(2 * psi)) / 2
        for part, psi in zip(transmissions, np.radians(angles_deg), strict=False)
    ]
    powers_w = np.repeat([*signals, DARK_W], REPEATS)
    if noise is not None:
        exposures_s = np.full(len(powers_w), EXPOSURE_S)
        powers_w = powers_w + noise.standard_normal(len(powers_w)) * np.sqrt(NOISE.variance(powers_w, exposures_s))
    lit = len(signals) * REPEATS
    return [
        Reading(
            *(point, "signal" if place < lit else "dark", place % REPEATS, 10.0 * point + 0.1 * place, 60.0, exit_deg),
            *(0.0, place // REPEATS + 2, angles_deg[place // REPEATS] if place < lit else None, EXPOSURE_S, power_w),
        )
        for place, power_w in enumerate(powers_w.tolist())
    ]


def lamp_out(readings, places):
    """The same readings, some of them taken in the dark."""
    return [replace(one, power_w=DARK_W) if place in places else one for place, one in enumerate(readings)]


def doubts(*directions):
    reduction = Reduction(Radiometry(BEAM_W, ACCEPTANCE_SR), NOISE, has_dark=True)
    readings = [reading for each in directions for reading in each]
    return reduction.doubts(readings, reduction.scan(readings))


GREY = (0.3, 0.05, -0.02)


def test_a_steady_lamp_is_not_doubted():
    assert doubts(*(direction(point, GREY) for point in range(5))) == ()


@pytest.mark.parametrize(
    "places", [range(3), range(9, 12), [4], range(4, 6), range(3, 12), range(6)], ids=lambda places: str([*places])
)
def test_a_lamp_that_is_out_for_a_part_of_a_direction_is_noticed_there(places):
    directions = [direction(point, GREY) for point in range(5)]
    directions[3] = lamp_out(directions[3], set(places))
    (said,) = doubts(*directions)
    assert said.startswith("The readings of point 3 ")
    assert "Look at the lamp and the beam" in said


def test_a_lamp_that_is_out_for_a_whole_direction_is_noticed_between_bright_ones():
    directions = [direction(point, GREY) for point in range(5)]
    directions[2] = lamp_out(directions[2], set(range(SIGNALS)))
    (said,) = doubts(*directions)
    assert "point 2 show less than a tenth of the light of the directions on both sides" in said


def test_a_sweep_through_a_dark_moment_names_all_its_directions():
    directions = [lamp_out(direction(point, GREY), {3, 4, 5} if 1 <= point <= 3 else ()) for point in range(5)]
    (said,) = doubts(*directions)
    assert said.startswith("The readings of points 1 to 3 are dark in a part")


def test_dark_directions_are_compared_along_one_incidence_only():
    bright = [direction(point, GREY) for point in range(0, 6, 2)]
    black = [
        [replace(one, incidence_deg=20.0) for one in direction(point, (1e-6, 0.0, 0.0))] for point in range(1, 6, 2)
    ]
    assert doubts(*bright, *black) == ()


@pytest.mark.parametrize(
    "s0", [[1e-4, 1e-4, 50.0, 1e-4, 1e-4], [50.0, 1e-4, 1e-4, 1e-4, 50.0], [5.0, 2.0, 0.3, 2.0, 5.0]]
)
def test_narrow_peaks_and_the_dark_beside_them_are_no_doubt(s0):
    assert doubts(*(direction(point, (one, 0.1 * one, 0.0)) for point, one in enumerate(s0))) == ()


@pytest.mark.parametrize("aolp_deg", range(0, 180, 15))
def test_light_that_a_polarizer_puts_out_is_no_doubt(aolp_deg):
    polarized = 0.3 * np.cos(np.radians(2 * aolp_deg)), 0.3 * np.sin(np.radians(2 * aolp_deg))
    assert doubts(*(direction(point, (0.3, *polarized)) for point in range(3))) == ()


def test_slots_that_transmit_five_percent_more_or_less_are_no_doubt():
    random = np.random.default_rng(3)
    for _ in range(200):
        dolp, angle = random.uniform(0.0, 1.0), random.uniform(0.0, 2 * np.pi)
        stokes = 0.3, 0.3 * dolp * np.cos(angle), 0.3 * dolp * np.sin(angle)
        slots = tuple(random.uniform(0.95, 1.05, 4))
        assert doubts(*(direction(point, stokes, slots, random) for point in range(3))) == ()


def test_weak_light_in_noise_is_no_doubt():
    random = np.random.default_rng(4)
    noise_of_s0 = 2e-11 / (BEAM_W * ACCEPTANCE_SR)
    for share in np.repeat([0.0, 0.3, 1.0, 3.0, 10.0, 30.0], 50):
        stokes = tuple(share * noise_of_s0 * np.array([1.0, 0.5, 0.3]))
        reduction = Reduction(Radiometry(BEAM_W, ACCEPTANCE_SR), NOISE, has_dark=True)
        readings = [one for point in range(5) for one in direction(point, stokes, noise=random)]
        assert list(unsteady(reduction.scan(readings))) == []


def test_three_polarizers_alone_cannot_tell_a_slot_in_the_dark_from_polarized_light():
    lost = lamp_out(direction(1, GREY, angles_deg=(0.0, 60.0, 120.0)), {0, 1, 2})
    others = [direction(point, GREY, angles_deg=(0.0, 60.0, 120.0)) for point in (0, 2)]
    assert doubts(others[0], lost, others[1]) == ()
