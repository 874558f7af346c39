"""The covariance of a fit takes in what a calibration's error does to all directions at once."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acquisition.calibrated_slots import SlotCalibration
from goniometer.calibrating.shared_error import shifted, with_shared_error
from model.fit import Dataset, fit
from model.lobes import Diffuse, Specular
from model.surface import Surface


def calibration():
    rng = np.random.default_rng(1)
    mixing = np.eye(6) + 0.3 * rng.normal(size=(6, 6))
    covariance = mixing @ mixing.T
    unit = np.sqrt(np.diag(covariance))
    errors = {"angle_stderr_deg": 0.1, "leak_stderr": 1e-3, "transmission_stderr": 0.0}
    return SlotCalibration(
        calibration="test",
        measured="2026-01-31T12:00:00+00:00",
        rig="bench",
        devices={"wheel": "thorlabs_fw102c"},
        analyzer="wheel",
        offset_deg=0.0,
        layout={2: 0.0, 3: 60.0},
        wavelength_nm=550.0,
        reference="polarizer",
        scans=("one",),
        chi_square=10.0,
        degrees_of_freedom=9,
        relative_to_slot=2,
        slots={
            2: errors | {"holds": 0.0, "angle_deg": 1.0, "leak": 0.005, "transmission": 1.0},
            3: errors
            | {"holds": 60.0, "angle_deg": 59.0, "leak": 0.002, "transmission": 0.9, "transmission_stderr": 0.01},
        },
        correlation=(covariance / np.outer(unit, unit)).tolist(),
    )


def test_a_fit_that_follows_the_calibration_linearly_gets_its_covariance_by_the_same_line():
    """theta = theta_0 + M c: what is added must be M C M^T, whatever axes the covariance has."""
    surface = Surface([Specular(0.7, 0.2, 1.5), Diffuse(0.1, 0.2)])
    angles = np.radians(np.arange(0.0, 60.0, 5.0))
    directions = np.full_like(angles, 1.0), angles, np.full_like(angles, np.pi)
    values = surface.stokes(*directions)[:, :3]
    data = Dataset(*directions, values=values, covariance=np.tile(1e-6 * np.eye(3), (len(angles), 1, 1)))
    result = fit(data, surface, start={"sigma": 0.2, "n": 1.5, "k": 0.0, "rho_s": 0.7, "rho_d": 0.1})
    given, names = calibration(), result.names
    line = np.random.default_rng(2).normal(size=(len(names), 6)) * [1.0, 50.0, 5.0, 1.0, 50.0, 5.0]
    origin = np.array([value for found in given.slots.values() for value in found.values])

    def refit(moved, start):
        by = np.array([value for found in moved.slots.values() for value in found.values]) - origin
        there = {
            name: replace(result.parameters[name], value=start[name] + change)
            for name, change in zip(names, line @ by, strict=True)
        }
        return replace(result, parameters=result.parameters | there)

    enlarged = with_shared_error(result, given, refit)
    before, after = (
        one.correlation * np.outer(*[[one.parameters[name].stderr for name in names]] * 2) for one in (result, enlarged)
    )
    assert_allclose(after - before, line @ given.covariance @ line.T, rtol=1e-6, atol=1e-9)
    assert {name: one.value for name, one in enlarged.parameters.items()} == result.values


def test_a_shift_moves_each_slot_by_its_own_amounts():
    moved = shifted(calibration(), np.array([0.1, 0.01, 0.2, -0.3, 0.02, -0.1]))
    assert_allclose(moved.slots[2].values, (1.1, 0.015, 1.2))
    assert_allclose(moved.slots[3].values, (58.7, 0.022, 0.8))
