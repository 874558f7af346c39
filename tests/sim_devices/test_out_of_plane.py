"""Light out of the plane of incidence, against geometry and Fresnel's laws written out anew: signs of S2 and S3.

Frame of the bench: z along the sample's normal, the source in the half plane y = 0, x > 0. The detector arm turns
towards -x, and its axis about z, right-handed.
"""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim_devices.effects.measurement import Moment
from sim_devices.world import World

INDEX = 2.950 + 2.932j
"""Iron at 550 nm."""
DEVICES = {
    "arms": {"type": "newport_esp301", "axes": {1: "source_arm", 2: "detector_arm", 3: "detector_azimuth"}},
}
MIRRORLIKE = {"material": "Fe", "sigma": 0.3, "rho_s": 0.7, "rho_d": 0.0, "rho_dd": 0.0}
NORMAL = np.array([0.0, 0.0, 1.0])


def arms(incidence_deg, exit_deg, azimuth_deg):
    """Unit vectors to the source and to the detector."""
    source, detector, azimuth = np.radians([incidence_deg, exit_deg, azimuth_deg])
    to_source = np.array([math.sin(source), 0.0, math.cos(source)])
    in_plane = np.array([-math.sin(detector), 0.0, math.cos(detector)])
    turn = np.array([[math.cos(azimuth), -math.sin(azimuth), 0], [math.sin(azimuth), math.cos(azimuth), 0], [0, 0, 1]])
    return to_source, turn @ in_plane


def unit(vector):
    return vector / np.linalg.norm(vector)


def reflected(to_source, to_detector, lamp_s1):
    """Stokes vector over S0 of light that one facet mirrors to the detector, with x = normal × ray and y = ray × x.

    The lamp's S1 is along the same axis of the incoming ray.
    """
    rays = -to_source, to_detector
    frames = [(unit(np.cross(NORMAL, ray)), np.cross(ray, unit(np.cross(NORMAL, ray)))) for ray in rays]
    s = unit(np.cross(*rays))
    facets = [(s, np.cross(ray, s)) for ray in rays]
    cosine = float(unit(to_source + to_detector) @ to_source)
    inner = np.sqrt(INDEX**2 - 1 + cosine**2)
    r_s, r_p = (cosine - inner) / (cosine + inner), (INDEX**2 * cosine - inner) / (INDEX**2 * cosine + inner)
    into, out = (
        np.array([[axis @ other for other in frame] for axis in facet])
        for frame, facet in zip(frames, facets, strict=True)
    )
    jones = out.T @ np.diag([r_s, r_p]) @ into
    stokes = np.zeros(4)
    for place, weight in enumerate((0.5 * (1 + lamp_s1), 0.5 * (1 - lamp_s1))):
        ex, ey = jones[:, place]
        stokes += weight * np.array(
            [
                abs(ex) ** 2 + abs(ey) ** 2,
                abs(ex) ** 2 - abs(ey) ** 2,
                2 * (ex * ey.conj()).real,
                2 * (ex * ey.conj()).imag,
            ]
        )
    return stokes / stokes[0]


@pytest.fixture
def seen(scene_document, scene_with):
    """What arrives at the analyzer, with the axes at these angles."""

    def look(incidence_deg, exit_deg, azimuth_deg, *, lamp_s1=0.0, sample=MIRRORLIKE, effects=()):
        start_deg = {"source_arm": incidence_deg, "detector_arm": exit_deg, "detector_azimuth": azimuth_deg}
        lamp = [{"effect": "polarized_lamp", "s1": lamp_s1}] if lamp_s1 else []
        scene = scene_with(
            sample=sample,
            devices=scene_document["devices"] | DEVICES,
            start_deg=start_deg,
            effects=[*lamp, *effects],
        )
        return World(scene).arriving_w(Moment(0.0, 0.0))

    return look


DIRECTIONS = [(60, 40, 20), (60, 40, -20), (35, 55, 60), (45, 20, -110), (50, -30, 40), (50, -30, -40), (20, 0, 35)]


@pytest.mark.parametrize(("incidence_deg", "exit_deg", "azimuth_deg"), DIRECTIONS)
@pytest.mark.parametrize("lamp_s1", [0.0, 0.8, -0.8])
def test_polarization_is_that_of_the_facet_between_the_arms(seen, incidence_deg, exit_deg, azimuth_deg, lamp_s1):
    to_source, to_detector = arms(incidence_deg, exit_deg, azimuth_deg)
    if exit_deg == 0:  # the limit along the arm's plane
        _, to_detector = arms(incidence_deg, 1e-7, azimuth_deg)
    stokes = seen(incidence_deg, exit_deg, azimuth_deg, lamp_s1=lamp_s1)
    assert_allclose(stokes / stokes[0], reflected(to_source, to_detector, lamp_s1), atol=1e-6)
    assert abs(stokes[2]) > 0.002 * stokes[0], "else the sign shows nothing"


@pytest.mark.parametrize(("incidence_deg", "exit_deg", "azimuth_deg"), [(60, 40, 20), (50, -30, 40), (35, 60, 130)])
def test_mirror_images_differ_in_the_signs_of_s2_and_s3_alone(seen, incidence_deg, exit_deg, azimuth_deg):
    """The mirror is the plane of incidence, which leaves the sample and a lamp polarized along it as they are."""
    there = seen(incidence_deg, exit_deg, azimuth_deg, lamp_s1=0.8)
    mirrored = seen(incidence_deg, exit_deg, -azimuth_deg, lamp_s1=0.8)
    assert_allclose(mirrored, there * [1, 1, -1, -1], rtol=1e-9)
    assert (np.abs(there[2:]) > 0.003 * there[0]).all(), "else the signs show nothing"


def test_half_a_turn_is_the_other_side_of_the_normal(seen):
    assert_allclose(seen(50, 30, 180), seen(50, -30, 0), rtol=1e-9, atol=1e-22)
    assert_allclose(seen(-50, 30, 25), seen(50, -30, 25), rtol=1e-12)


@pytest.mark.parametrize(
    ("effect", "true_deg"),
    [({"effect": "zero_offset", "offset_deg": 3.0}, 23.0), ({"effect": "flexure", "amplitude_deg": 2.0}, None)],
)
def test_effects_of_arms_act_on_the_detectors_azimuth(seen, effect, true_deg):
    true_deg = true_deg or 20 + 2 * math.sin(math.radians(20))
    found = seen(60, 40, 20, effects=[effect | {"axis": "detector_azimuth"}])
    assert_allclose(found, seen(60, 40, true_deg), rtol=1e-9, atol=1e-22)


def test_backlash_leaves_the_detectors_azimuth_behind(scene_document, scene_with):
    play = {"effect": "backlash", "axis": "detector_azimuth", "play_deg": 0.5}
    world = World(scene_with(devices=scene_document["devices"] | DEVICES, effects=[play]))
    fast = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
    for target_deg, start_s in ((20.0, 0.0), (10.0, 10.0)):
        world.axes["detector_azimuth"].move(target_deg, start_s, **fast)
    assert abs(world.angle_deg["detector_azimuth"](19.0) - 10.0) == pytest.approx(0.25)


def test_an_effect_on_an_axis_that_nothing_turns_is_refused(scene_with):
    with pytest.raises(ValueError, match="zero_offset of detector_azimuth is on an axis that no device turns"):
        scene_with(effects=[{"effect": "zero_offset", "axis": "detector_azimuth", "offset_deg": 1.0}])
