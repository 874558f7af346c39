"""A camera on the bench sees the plate where arms, analyzer and lamp are during the exposure, with effects."""

import math
import urllib.request
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import ValidationError

from sim_devices.analyzer import analyzer_row
from sim_devices.bench import Bench
from sim_devices.camera.optics import Vignetting, Wedge, seen_through
from sim_devices.camera.render import Renderer
from sim_devices.effects.measurement import Moment
from sim_devices.effects.reference_polarizer import ReferencePolarizer
from sim_devices.scene import Scene
from sim_devices.serving.clock import VirtualClock
from sim_devices.world import World

FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
PLATE = {
    "size_mm": [60, 40],
    "patches": [{"disk_mm": [5, 3, 8], "material": "Au", "sigma": 0.2, "rho_s": 1, "rho_d": 0.1, "rho_dd": 0}],
}
PIXEL_SR_W = 1e-3 * 1e-4 * 1e-3
"""Of lamp, pixel share and acceptance."""


def aimed(world, incidence_deg=50.0, exit_deg=35.0, azimuth_deg=20.0, slot=1):
    """Turn the bench to a geometry; it rests there at 10 s."""
    for role, angle_deg in (
        ("source_arm", incidence_deg),
        ("detector_arm", exit_deg),
        ("sample_azimuth", azimuth_deg),
    ):
        world.axes[role].move(angle_deg, 0.0, **FAST)
    if slot != 1:
        world.analyzer.wheel.turn(slot, 0.0, slots=6, slot_s=0.5)
    return world


def power_w(world, time_s=20.0, exposure_s=0.1):
    return world.devices["camera"].camera.light.power_w(Moment(time_s, exposure_s))


def plate_radiance(scene, incidence_deg, exit_deg, azimuth_deg, wavelength_nm=550, **renders):
    """In units of the irradiance across the beam, which spreads over more of the plate the more obliquely it falls."""
    layout = scene.plate.load(Path(), scene.sample)
    renderer = Renderer(layout, scene.devices["camera"].view(), wavelength_nm, **renders)
    return np.cos(np.radians(incidence_deg)) * renderer.stokes(incidence_deg, exit_deg, azimuth_deg)


@pytest.mark.parametrize(("slot", "analyzer_deg"), [(1, "open"), (2, 0), (3, 45), (4, 90), (5, 135)])
@pytest.mark.parametrize("place", [(50.0, 35.0, 0.0), (5.0, -35.0, 20.0), (60.0, 70.0, 0.0)])
def test_each_pixel_sees_lamp_share_acceptance_and_analyzer_and_no_cosine_of_the_exit(
    camera_scene, slot, analyzer_deg, place
):
    scene = camera_scene(plate=PLATE)
    seen_w = power_w(aimed(World(scene), *place, slot=slot))
    expected_w = PIXEL_SR_W * np.tensordot(analyzer_row(analyzer_deg), plate_radiance(scene, *place), 1)
    assert expected_w.max() > 1e-12
    assert_allclose(seen_w, expected_w, rtol=1e-5, atol=1e-6 * expected_w.max())


def test_a_still_holds_the_counts_of_its_exposure(camera_scene):
    scene = camera_scene(plate=PLATE, camera={"joules_per_count": 1e-14})
    camera = aimed(World(scene)).devices["camera"]
    ((_, said),) = camera.session().receive(b"GET /still.png?exposure_s=0.5&bits=16 HTTP/1.1\r\nHost: x\r\n\r\n", 20.0)
    counts = cv2.imdecode(np.frombuffer(said.partition(b"\r\n\r\n")[2], np.uint8), cv2.IMREAD_UNCHANGED)
    expected = PIXEL_SR_W * plate_radiance(scene, 50.0, 35.0, 20.0)[0] * 0.5 / 1e-14
    assert expected.max() > 1000
    assert_allclose(counts, expected, atol=0.51)


def test_it_is_dark_behind_a_lid_and_while_the_wheel_turns(camera_scene):
    world = aimed(World(camera_scene()), slot=6)
    assert power_w(world) is None
    world.analyzer.wheel.turn(3, 30.0, slots=6, slot_s=0.5)
    assert power_w(world, 30.7) is None
    assert power_w(world, 32.0).max() > 0


def test_a_picture_is_that_of_the_middle_of_its_exposure(camera_scene):
    scene = camera_scene(plate=PLATE)
    world = aimed(World(scene), 50.0, 0.0, 0.0)
    world.axes["detector_arm"].move(
        40.0, 20.0, velocity_deg_s=10.0, acceleration_deg_s2=100.0, deceleration_deg_s2=100.0
    )
    session = world.devices["camera"].session()
    session.receive(b"GET /still.png?exposure_s=2 HTTP/1.1\r\nHost: x\r\n\r\n", 21.0)
    middle_deg = world.axes["detector_arm"].motor_deg(22.0)
    assert 10 < middle_deg < 30
    expected = PIXEL_SR_W * plate_radiance(scene, 50.0, middle_deg, 0.0)[0] * 2.0 / 1e-15
    counts = world.devices["camera"].camera.last.counts
    assert_allclose(counts, np.minimum(np.rint(expected), 65535), atol=1)


@pytest.mark.parametrize(
    "effects",
    [
        [{"effect": "lamp_drift", "relative_per_hour": -0.9}],
        [{"effect": "lamp_walk", "relative_per_root_hour": 0.9}],
        [{"effect": "flicker", "relative_amplitude": 0.4, "frequency_hz": 0.913}],
        [
            {"effect": "lamp_drift", "relative_per_hour": 0.5},
            {"effect": "flicker", "relative_amplitude": 0.4, "frequency_hz": 1.113},
        ],
    ],
)
def test_a_lamp_that_changes_is_seen_by_every_pixel(camera_scene, effects):
    steady, changing = aimed(World(camera_scene())), aimed(World(camera_scene(effects=effects)))
    for time_s in (20.0, 400.0):
        factor = changing.power_w(time_s) / steady.power_w(time_s)
        assert abs(factor - 1) > 1e-3
        assert_allclose(power_w(changing, time_s, 0.0), factor * power_w(steady, time_s, 0.0), rtol=1e-5)


def test_flicker_is_averaged_over_the_exposure(camera_scene):
    effects = [{"effect": "flicker", "relative_amplitude": 0.5, "frequency_hz": 2.0}]
    steady, flickering = aimed(World(camera_scene())), aimed(World(camera_scene(effects=effects)))
    seen = 1 + 0.5 * math.sin(math.pi * 0.6) / (math.pi * 0.6) * math.sin(4 * math.pi * 20.1)
    assert_allclose(power_w(flickering, 20.1, 0.3), seen * power_w(steady, 20.1, 0.3), rtol=1e-5)


def test_a_lamp_that_is_off_is_dark_in_pictures(camera_scene):
    scene = camera_scene(faults=[{"fault": "lamp_off", "at_s": 20.0, "for_s": 5.0}])
    with Bench(scene, VirtualClock()) as bench:
        aimed(bench.world)
        bench.clock.sleep(21.0)
        assert power_w(bench.world, 19.0).max() > 0
        assert power_w(bench.world, 21.0).max() == 0
        assert power_w(bench.world, 26.0).max() > 0


def test_a_reference_polarizer_acts_on_every_pixel(camera_scene):
    effect = {"effect": "reference_polarizer", "angle_deg": 30.0, "extinction_ratio": 100.0}
    scene = camera_scene(plate=PLATE, effects=[effect])
    matrix = ReferencePolarizer.model_validate(effect).mueller()
    stokes = plate_radiance(scene, 50.0, 35.0, 20.0)
    expected_w = PIXEL_SR_W * np.tensordot(analyzer_row(90) @ matrix, stokes, 1)
    assert_allclose(power_w(aimed(World(scene), slot=4)), expected_w, rtol=1e-4, atol=1e-6 * expected_w.max())


def test_whatever_turns_and_joins_the_light_before_the_analyzer_is_seen(camera_scene):
    lamp = {"power_w": 10.0, "wavelength_nm": 550}
    scene = camera_scene(plate=PLATE, lamp=lamp, camera={"acceptance_sr": 0.1})
    world = aimed(World(scene), slot=3)
    sample_w, matrix, joins_w = world.arriving_w, np.arange(16.0).reshape(4, 4), np.array([0.5, 0.2, 0.3, 0.0])
    world.arriving_w = lambda moment: matrix @ sample_w(moment) + joins_w
    arriving_w = np.tensordot(matrix, 10.0 * 0.1 * plate_radiance(scene, 50.0, 35.0, 20.0), 1) + joins_w[:, None, None]
    assert_allclose(power_w(world), 1e-4 * np.tensordot(analyzer_row(45), arriving_w, 1), rtol=1e-4)


def test_stray_light_falls_on_the_plates_surroundings_too(camera_scene):
    world = aimed(World(camera_scene(effects=[{"effect": "stray_light", "power_w": 1e-6}])), slot=3)
    clean = aimed(World(camera_scene()), slot=3)
    assert_allclose(power_w(world) - power_w(clean), 1e-6 * 1e-4 / 2, rtol=1e-4)


@pytest.mark.parametrize(
    "effect",
    [
        {"effect": "extinction_ratio", "ratio": 5.0},
        {"effect": "slot_angle_errors", "errors_deg": {3: 20.0}},
        {"effect": "slot_transmissions", "relative": {3: 0.4}},
        {"effect": "wheel_wobble", "stddev_deg": 10.0},
    ],
)
def test_what_is_wrong_with_the_analyzer_is_seen(camera_scene, effect):
    scene = camera_scene(plate=PLATE, effects=[effect])
    world = aimed(World(scene), slot=3)
    row = world.row(20.0)
    assert np.abs(row - analyzer_row(45)).max() > 0.05
    expected_w = PIXEL_SR_W * np.tensordot(row, plate_radiance(scene, 50.0, 35.0, 20.0), 1)
    assert_allclose(power_w(world), expected_w, rtol=1e-4, atol=1e-6 * expected_w.max())


def test_arms_that_stand_elsewhere_than_their_motors_are_seen_there(camera_scene):
    scene = camera_scene(plate=PLATE, effects=[{"effect": "zero_offset", "axis": "detector_arm", "offset_deg": 3.0}])
    expected_w = PIXEL_SR_W * plate_radiance(scene, 50.0, 38.0, 20.0)[0]
    assert_allclose(power_w(aimed(World(scene))), expected_w, rtol=1e-4, atol=1e-6 * expected_w.max())


def test_a_polarized_lamp_lights_the_plate(camera_scene):
    scene = camera_scene(plate=PLATE, effects=[{"effect": "polarized_lamp", "s1": 0.6, "s2": 0.3}])
    expected_w = PIXEL_SR_W * plate_radiance(scene, 50.0, 35.0, 20.0, lamp_stokes=[1.0, 0.6, 0.3, 0.0])[0]
    assert_allclose(power_w(aimed(World(scene))), expected_w, rtol=1e-4, atol=1e-6 * expected_w.max())


def test_filters_choose_the_light_and_dim_it(camera_scene):
    filters = {1: {"wavelength_nm": 550}, 2: {"wavelength_nm": 570, "transmission": 0.5}}
    wheel = {"type": "thorlabs_fw102c_filters", "filters": filters}
    scene = camera_scene(plate=PLATE, devices={"filters": wheel}, lamp={"power_w": 1e-3})
    world = aimed(World(scene))
    assert_allclose(power_w(world), PIXEL_SR_W * plate_radiance(scene, 50.0, 35.0, 20.0)[0], rtol=1e-4, atol=1e-16)
    world.filters.wheel.turn(2, 30.0, slots=6, slot_s=0.5)
    other = plate_radiance(scene, 50.0, 35.0, 20.0, 570)[0]
    assert_allclose(power_w(world, 30.2), 0.0)
    assert_allclose(power_w(world, 40.0), 0.5 * PIXEL_SR_W * other, rtol=1e-4, atol=1e-16)


def test_lens_and_wedge_act_on_what_the_analyzer_passes(camera_scene):
    lens = [{"effect": "vignetting"}, {"effect": "wedge", "deviation_px": 3.0, "direction_deg": 10.0}]
    scene = camera_scene(plate=PLATE, camera={"lens": lens})
    sharp = PIXEL_SR_W * np.tensordot(analyzer_row(90), plate_radiance(scene, 50.0, 35.0, 20.0), 1)
    parts = [Vignetting(effect="vignetting"), Wedge(effect="wedge", deviation_px=3.0, direction_deg=10.0)]
    expected_w = seen_through(parts, sharp, scene.devices["camera"].view(), 90.0)
    assert np.abs(expected_w - sharp).max() > 0.1 * sharp.max()
    expected_w = np.maximum(expected_w, 0)
    assert_allclose(power_w(aimed(World(scene), slot=4)), expected_w, rtol=1e-3, atol=1e-5 * sharp.max())


def test_the_bench_serves_it_by_a_url_that_ordinary_clients_know(camera_scene):
    with Bench(camera_scene(), VirtualClock()) as bench:
        address = bench.addresses["camera"]
        assert address.tcp.startswith("http://127.0.0.1:")
        assert address.pty is None
        with urllib.request.urlopen(f"{address.tcp}/still.png?exposure_s=0.25", timeout=10) as answer:
            counts = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_UNCHANGED)
        assert bench.clock.now() == pytest.approx(0.28)
    assert counts.shape == (36, 48)


def test_the_same_scene_gives_the_same_noise(camera_scene):
    sensor = {"electrons_per_count": 2.0, "read_counts": 2.0, "dark_counts": 60.0}
    ask = b"GET /still.png?exposure_s=0.001 HTTP/1.1\r\nHost: x\r\n\r\n"
    stills = [
        World(camera_scene(camera={"sensor": sensor})).devices["camera"].session().receive(ask, 1.0) for _ in "ab"
    ]
    assert stills[0] == stills[1]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"plate": None}, "a camera needs a plate to look at"),
        ({"effects": [{"effect": "shot_noise"}]}, "name electrons_per_count in the camera's sensor"),
        ({"effects": [{"effect": "read_noise", "power_w": 1e-9}]}, "name read_counts in the camera's sensor"),
        ({"effects": [{"effect": "dark_current", "power_w": 1e-9}]}, "name dark_counts and dark_counts_per_s in"),
        (
            {"effects": [{"effect": "nonlinearity", "relative_loss": 0.1, "at_power_w": 1e-6}]},
            "the effect nonlinearity is one of a detector without pixels; name nonlinearity in",
        ),
        ({"effects": [{"effect": "quantisation", "digits": 4}]}, "a camera's bits do what the effect"),
        ({"effects": [{"effect": "saturation", "power_w": 1e-6}]}, "a camera's bits do what the effect"),
        ({"effects": [{"effect": "acceptance_cone"}]}, "acceptance_cone is not simulated for a camera"),
        ({"faults": [{"fault": "detector_saturated"}]}, "the fault of its pictures is frame_saturated"),
        ({"camera": {"bits": [12, 8]}}, "bits are given once each, in rising order"),
        ({"camera": {"sensor": {"hot_pixels": 5000}}}, "hot_pixels is 5000, and the sensor has 1728 pixels"),
    ],
)
def test_a_scene_that_no_camera_can_have_is_refused(camera_scene, change, says):
    with pytest.raises(ValidationError, match=says):
        camera_scene(**change)


def test_a_plate_without_a_camera_is_refused(scene_document):
    with pytest.raises(ValidationError, match="has a plate, which only a camera sees"):
        Scene.model_validate(scene_document | {"plate": {"size_mm": [60, 40]}})


def test_the_bench_beside_the_camera_is_as_it_was(camera_scene, scene_with):
    with_camera, with_meter = aimed(World(camera_scene())), aimed(World(scene_with()))
    assert with_camera.power_w(20.0) == with_meter.power_w(20.0)
    assert_array_equal(with_camera.row(20.0), with_meter.row(20.0))
