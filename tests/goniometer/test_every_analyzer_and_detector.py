"""Every analyzer and every detector against its simulated device, through rig and scene: what is read is the light."""

from __future__ import annotations

import math

import pytest
from numpy.testing import assert_allclose

from goniometer.errors import ConfigurationError, DeviceFaultError
from sim_devices.effects.measurement import Moment

FOUR = {1: 0, 2: 45, 3: 90, 4: 135}
ROTATING = {"analyzer": {"driver": "rotating_polarizer", "slots": FOUR}}
SLIDER = {
    "analyzer": {"driver": "thorlabs_elliptec_slider", "address": "1", "slots": FOUR, "slot_s": 0.6, "settle_s": 0.05}
}
SIMULATED_SLIDER = {"analyzer": {"type": "thorlabs_elliptec_slider", "address": "1", "slots": FOUR}}


def turning(speed, acceleration, **more):
    return {
        "limits_deg": [-5, 180],
        "velocity_deg_s": speed,
        "acceleration_deg_s2": acceleration,
        "settle_s": 0.05,
        "tolerance_deg": 0.1,
    } | more


def rotating(driver, speed, acceleration, scene, **rig):
    """A polarizer on a rotator."""
    rotator = {"driver": driver, "axes": {"polarizer": turning(speed, acceleration)}} | rig
    simulated = {"rotator": {"type": driver} | scene, "analyzer": {"type": "rotating_polarizer"}}
    return ROTATING | {"rotator": rotator}, simulated


ROTATORS = {
    "ELL14": rotating("thorlabs_elliptec", 430, 8600, {"axis": "polarizer"}),
    "ELL18": rotating("thorlabs_elliptec", 300, 8600, {"axis": "polarizer", "model": "ELL18"}),
    "K10CR1": rotating("thorlabs_apt", 10, 20, {"stage": "K10CR1", "axes": {1: "polarizer"}}, stage="K10CR1"),
    "PRM1Z8": rotating("thorlabs_apt", 20, 20, {"stage": "PRM1Z8", "axes": {1: "polarizer"}}, stage="PRM1Z8"),
    "LEC": rotating("smc_lec", 100, 1000, {"unit": 1, "axis": "polarizer"}, unit=1),
}


def aimed(room):
    """The bench with light on its detector."""
    room.move(room.devices.source_arm, 60)
    room.move(room.devices.detector_arm, 40)
    return room


@pytest.mark.parametrize("which", ROTATORS)
def test_a_rotating_polarizer_passes_what_malus_says(open_room, which):
    room = aimed(open_room(*ROTATORS[which], start_deg={"polarizer": 30.0}))
    room.home(room.devices.polarizer)
    read_w = {}
    for slot in (1, 2, 3, 4, 2):
        room.select(slot)
        assert room.devices.analyzer.slot() == slot
        read_w[slot] = room.read()
    s0, s1, s2, _ = 0.5 * room.world.arriving_w(Moment(room.clock.now(), 0.0))
    for slot, angle_deg in FOUR.items():
        twice_rad = 2 * math.radians(angle_deg)
        assert_allclose(read_w[slot], s0 + s1 * math.cos(twice_rad) + s2 * math.sin(twice_rad), rtol=2e-3)


def test_an_analyzer_between_its_slots_is_at_none(open_room):
    room = open_room(*ROTATORS["ELL14"])
    room.home(room.devices.polarizer)
    room.move(room.devices.polarizer, 20)
    assert room.devices.analyzer.slot() is None
    room.select(3)
    assert room.devices.analyzer.slot() == 3


def test_a_slider_passes_what_a_wheel_does(open_room):
    room = aimed(open_room(SLIDER, SIMULATED_SLIDER))
    wheel = aimed(open_room({}, {}))
    for slot in (1, 2, 4, 1, 3):
        room.select(slot)
        wheel.select(slot + 1)
        assert room.devices.analyzer.slot() == slot
        assert_allclose(room.read(), wheel.read(), rtol=1e-12)


def test_a_slider_stopped_on_its_way_rests_at_the_next_slot(open_room):
    room = open_room(SLIDER, SIMULATED_SLIDER)
    analyzer = room.devices.analyzer
    analyzer.start_select(4)
    room.poll(analyzer, 0.3)
    analyzer.stop()
    room.rest(analyzer)
    assert room.world.analyzer.wheel.slot(room.clock.now()) == analyzer.slot() == 2


def test_a_rotator_and_a_slider_share_a_bus_and_move_one_after_the_other(open_room):
    rotator = {"driver": "thorlabs_elliptec", "address": "2", "axes": {"sample_azimuth": turning(430, 8600)}}
    simulated = {"type": "thorlabs_elliptec", "address": "2", "axis": "sample_azimuth", "line": "bus"}
    slider = {"analyzer": SIMULATED_SLIDER["analyzer"] | {"line": "bus"}}
    room = open_room(SLIDER | {"stage": rotator}, slider | {"stage": simulated})
    assert room.addresses["stage"] == room.addresses["analyzer"]
    azimuth, analyzer = room.devices.sample_azimuth, room.devices.analyzer
    room.home(azimuth)
    azimuth.start_move(90)
    analyzer.start_select(2)
    room.rest(azimuth, analyzer)
    assert analyzer.slot() == 2
    assert_allclose([azimuth.position_deg(), room.true_deg()], 90, atol=0.02)


@pytest.mark.parametrize(
    ("rig", "scene", "message"),
    [
        (ROTATING, {"analyzer": {"type": "rotating_polarizer"}}, "no device has the axis polarizer; a bench needs"),
        (
            {"rotator": ROTATORS["ELL14"][0]["rotator"]},
            {"rotator": ROTATORS["ELL14"][1]["rotator"]},
            "devices.rotator.axes.polarizer': carries nothing; allowed: with driver: rotating_polarizer",
        ),
    ],
)
def test_a_polarizer_and_its_rotator_need_each_other(load, rig, scene, message):
    with pytest.raises(ConfigurationError, match=message):
        load(rig, scene)


LOCK_IN = {
    "driver": "stanford_sr830",
    "responsivity_v_per_w": 2e5,
    "time_constant_s": 0.1,
    "slope_db": 12,
    "sample_s": 0.4,
    "noise": {"read_w": 2e-12, "shot": True},
}
SIMULATED_LOCK_IN = {"type": "stanford_sr830", "acceptance_sr": 1e-4, "volts_per_watt": 2e5, "phase_deg": 70.0}


def lock_in(**changes):
    return {"meter": LOCK_IN | changes}, {"meter": SIMULATED_LOCK_IN}


def test_a_lock_in_tells_watts_as_soon_as_the_light_of_the_last_slot_has_gone(open_room):
    room = aimed(open_room(*lock_in()))
    for slot in (1, 6, 2, 6, 4):
        room.select(slot)
        begun_s = room.clock.now()
        assert_allclose(room.read(0.4), room.signal_w(), rtol=1e-4, atol=1e-13)
        assert room.clock.now() - begun_s < 0.1 * 11.8 + 0.4 + 0.1


def test_a_lock_in_takes_the_next_full_scale_where_it_may(open_room):
    room = aimed(open_room(*lock_in(raises_sensitivity=True)))
    full_scale = room.devices.detector._lock_in
    room.select(1)
    full_scale.set_sensitivity(14)  # 100 uV
    assert_allclose(room.read(0.4), room.signal_w(), rtol=1e-4)
    volts, index = 2e5 * room.signal_w(), full_scale.sensitivity()
    assert volts < (2, 5, 10)[index % 3] * 10.0 ** (index // 3 - 9) < 3 * volts


def test_a_lock_in_that_overloads_gives_no_reading_otherwise(open_room):
    room = aimed(open_room(*lock_in()))
    room.select(1)
    room.devices.detector._lock_in.set_sensitivity(14)
    with pytest.raises(DeviceFaultError, match=r"meter: the detector was saturated: .* output overload"):
        room.read(0.4)


def test_a_chopper_that_stands_still_is_a_fault_and_not_a_zero(open_room):
    room = aimed(open_room(*lock_in()))
    room.select(1)
    room.world.devices["meter"].set_chopper(0.0, room.clock.now())
    with pytest.raises(DeviceFaultError, match="meter: the lock-in reports unlocked during the reading"):
        room.read(0.4)


def test_a_lock_in_that_was_reset_is_a_fault_and_not_a_zero(open_room):
    room = aimed(open_room(*lock_in()))
    room.read(0.4)
    room.devices.detector._lock_in._dialogue.tell("*RST")
    with pytest.raises(DeviceFaultError, match=r"meter: the lock-in was reset, .* internal reference"):
        room.read(0.4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time_constant_s": 0.2}, "time_constant_s': got 0.2; allowed: 1e-05, 3e-05, .* 0.1, 0.3"),
        ({"sample_s": 0.1}, "sample_s': got 0.1; allowed: at least 0.4, because samples less than 4 time constants"),
    ],
)
def test_a_filter_that_a_lock_in_has_not_is_refused(load, changes, message):
    with pytest.raises(ConfigurationError, match=message):
        load(*lock_in(**changes))
