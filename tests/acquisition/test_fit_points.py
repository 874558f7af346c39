"""Degrees become radians and come back; signed angles become directions; a fit section becomes a family of surfaces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.fit_choice import FitChoice
from acquisition.fit_points import dataset, directions, fit_arguments, in_degrees, surface_family
from acquisition.readings import StokesPoint
from goniometer.errors import FitError
from model.fit import Dataset, fit
from model.fit.quantities import quantity

CHOICE: dict[str, Any] = {
    "lobes": ["specular", "diffuse", "directional"],
    "free": {"sigma": [0.02, 1.0], "n": [1.0, 6.0], "k": [0.0, 8.0]},
}


def choice(**changes: Any) -> FitChoice:
    return FitChoice.model_validate({**CHOICE, **changes})


def point(incidence_deg: float, exit_deg: float) -> StokesPoint:
    return StokesPoint(0, incidence_deg, exit_deg, 0.0, np.ones(3), np.eye(3), 0.5, 0.5, 0.1, 0.0, 1.0)


@pytest.mark.parametrize(
    ("incidence_deg", "exit_deg", "azimuth_deg"),
    [(60.0, 30.0, 180.0), (60.0, -30.0, 0.0), (-0.0005, 30.0, 0.0), (-0.0005, -30.0, 180.0)],
)
def test_a_direction_keeps_its_side(incidence_deg: float, exit_deg: float, azimuth_deg: float) -> None:
    data = dataset([point(incidence_deg, exit_deg)])
    assert_allclose(np.degrees(data.incidence_rad), abs(incidence_deg))
    assert_allclose(np.degrees(data.exit_rad), abs(exit_deg))
    assert_allclose(np.degrees(data.azimuth_rad), azimuth_deg, atol=1e-9)


def test_an_azimuth_that_is_given_is_kept() -> None:
    assert_allclose(np.degrees(directions([60.0], [30.0], [100.0])), [[60.0], [30.0], [100.0]])


def test_angles_of_the_instrument_reach_the_family_in_radians() -> None:
    family = surface_family(
        choice(
            free={**CHOICE["free"], "exit_offset_deg": [-10, 10], "analyzer_offset_deg": [-45, 45]},
            fixed={"incidence_offset_deg": 0.5, "gain": 1.1},
            prior={"exit_offset_deg": [0.1, 0.02], "n": [2.95, 0.05]},
        ),
        None,
    )
    # The recipe's widest bounds are those of the model, to the last bit.
    assert family.free["exit_offset_rad"] == (quantity("exit_offset_rad").lowest, quantity("exit_offset_rad").highest)
    assert family.free["analyzer_offset_rad"][1] == quantity("analyzer_offset_rad").highest
    assert_allclose(family.fixed["incidence_offset_rad"], math.radians(0.5))
    assert family.fixed["gain"] == 1.1
    assert_allclose(family.prior["exit_offset_rad"], (math.radians(0.1), math.radians(0.02)))
    assert family.prior["n"] == (2.95, 0.05)
    assert not any(name.endswith("_deg") for name in (*family.free, *family.fixed, *family.prior))


def test_lobes_of_their_own_weights_and_ties_reach_the_family() -> None:
    family = surface_family(
        choice(
            free={"sigma": [0.02, 1.0], "directional.sigma": [0.1, 0.2], "n": [1.0, 6.0], "rho_s": [0.1, 0.9]},
            fixed={"rho_dd": 0.05},
            tied={"k": ["n", 1.0]},
        ),
        None,
    )
    assert family.free["rho_s"] == (0.1, 0.9)
    assert family.free["rho_d"] == (0.0, math.inf)
    specular, diffuse, directional = family.lobe_values(
        {"sigma": 0.3, "directional.sigma": 0.15, "n": 2.5, "rho_s": 0.7, "rho_d": 0.2}
    )
    assert (specular["sigma"], diffuse["sigma"], directional["sigma"]) == (0.3, 0.3, 0.15)
    assert specular["k"] == 2.5
    assert directional["rho_dd"] == 0.05


def test_what_was_turned_is_found_and_told_in_degrees() -> None:
    free = {**CHOICE["free"], "exit_offset_deg": [-2, 2], "analyzer_offset_deg": [-5, 5]}
    chosen = choice(free=free)
    family, exit_deg = surface_family(chosen, None), np.arange(-40.0, 71.0, 3.0)
    truth = {"sigma": 0.2, "n": 2.95, "k": 2.93, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
    seen = family.surface_of(truth).stokes(*directions(np.full(len(exit_deg), 60.0), exit_deg + 0.4))[:, :3]
    turn = math.radians(2.0 * 1.5)
    s1, s2 = seen[:, 1].copy(), seen[:, 2].copy()
    seen[:, 1], seen[:, 2] = math.cos(turn) * s1 + math.sin(turn) * s2, math.cos(turn) * s2 - math.sin(turn) * s1
    covariance = np.broadcast_to(1e-8 * np.eye(3), (len(exit_deg), 3, 3))
    data = Dataset(*directions(np.full(len(exit_deg), 60.0), exit_deg), seen, covariance)
    found = in_degrees(fit(data, family, **fit_arguments(chosen)))
    assert_allclose(found.values["exit_offset_deg"], 0.4, rtol=1e-6)
    assert_allclose(found.values["analyzer_offset_deg"], 1.5, rtol=1e-6)
    assert_allclose([found.values[name] for name in truth], list(truth.values()), rtol=1e-6)
    assert "exit_offset_deg" in found.names
    assert found.weakness is not None
    assert set(found.weakness.changes) == set(found.names)
    assert_allclose(found.covariance[-1, -1], found.parameters["analyzer_offset_deg"].stderr ** 2)


def test_what_is_in_degrees_stays_so() -> None:
    chosen = choice(free={**CHOICE["free"], "exit_offset_deg": [-2, 2]})
    family, exit_deg = surface_family(chosen, None), np.arange(0.0, 71.0, 3.0)
    where = directions(np.full(len(exit_deg), 60.0), exit_deg)
    values = family.surface_of({"sigma": 0.2, "n": 2.95, "k": 2.93, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}).stokes(
        *directions(np.full(len(exit_deg), 60.0), exit_deg + 0.4)
    )[:, :3]
    once = in_degrees(fit(Dataset(*where, values), family))
    assert in_degrees(once).to_dict() == once.to_dict()


def test_how_to_fit_comes_from_the_choice() -> None:
    assert fit_arguments(choice()) == {"objective": "stokes", "search": "sobol", "robust": False}
    changed = choice(objective="dolp", search="genetic", robust=True)
    assert fit_arguments(changed) == {"objective": "dolp", "search": "genetic", "robust": True}


def test_several_bounces_need_the_acceptance() -> None:
    assert surface_family(choice(bounces=3), 1e-4).detector_half_angle_rad > 0.0
    assert surface_family(choice(), 1e-4).detector_half_angle_rad == 0.0
    with pytest.raises(FitError, match=r"3 bounces, whose light depends on the detector's acceptance.*whole recipe"):
        surface_family(choice(bounces=3), None)
