"""Contact between simulated arms is found exactly when a fine look at their motion finds it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim_devices.axis import Axis
from sim_devices.contact import Bodies, ContactWatch

BODIES = Bodies(source_arm_half_deg=6.0, detector_arm_half_deg=5.0, frame_deg=110.0)


@pytest.fixture
def arms():
    axes = {role: Axis(0.0005) for role in ("source_arm", "detector_arm")}
    axes["detector_arm"].move(90.0, -10.0, **speed(1e4))
    return watch_of(axes), axes


def watch_of(axes):
    return ContactWatch(BODIES, axes, {role: axis.motor_deg for role, axis in axes.items()})


def speed(velocity_deg_s):
    return {
        "velocity_deg_s": velocity_deg_s,
        "acceleration_deg_s2": 10 * velocity_deg_s,
        "deceleration_deg_s2": 10 * velocity_deg_s,
    }


@pytest.mark.parametrize(
    ("source_deg", "detector_deg", "room_deg"),
    [(60, 60, 44), (60, -60, -11), (60, -40, 9), (-60, 71, 0), (60, 105, 0), (104, 0, 0), (0, -106, -1)],
)
def test_the_room_between_the_arms(source_deg, detector_deg, room_deg):
    assert_allclose(min(BODIES.rooms_deg(source_deg, detector_deg))[0], room_deg, atol=1e-12)


def test_a_brush_between_two_looks_is_found_at_its_moment(arms):
    watch, axes = arms
    # there and back again: at both ends the arms are far apart
    axes["detector_arm"].move(8.0, 10.0, **speed(20))
    axes["detector_arm"].move(90.0, 20.0, **speed(20))
    contact = watch.look(100.0)
    assert contact.parts == "source arm and detector arm"
    assert_allclose(axes["detector_arm"].position_deg(contact.time_s), 11.0, atol=1e-2)
    assert 10 < contact.time_s < 20


def test_random_motions_agree_with_a_fine_look():
    rng = np.random.default_rng(9)
    found = 0
    for _ in range(60):
        axes = {role: Axis(0.0005) for role in ("source_arm", "detector_arm")}
        axes["detector_arm"].move(60.0, -10.0, **speed(1e4))
        watch = watch_of(axes)
        time_s = 0.0
        for _ in range(4):
            role = rng.choice(["source_arm", "detector_arm"])
            axes[role].move(rng.uniform(-30, 100), time_s, **speed(rng.uniform(5, 40)))
            time_s += rng.uniform(0.5, 4.0)
        times_s = np.arange(0.0, time_s + 20, 2e-3)
        room_deg = [min(BODIES.rooms_deg(*(axis.motor_deg(t) for axis in axes.values())))[0] for t in times_s]
        contact = watch.look(time_s + 20)
        if abs(min(room_deg)) < 0.05:
            continue
        assert (contact is not None) == (min(room_deg) < 0)
        if contact is not None:
            found += 1
            assert_allclose(contact.time_s, times_s[np.argmax(np.array(room_deg) < 0)], atol=5e-3)
    assert 10 < found < 55


def test_what_was_to_happen_and_was_prevented_is_no_contact(arms):
    watch, axes = arms
    # two motions one after the other, as a controller queues them, of which the second would touch
    axes["detector_arm"].move(50.0, 10.0, **speed(20))
    axes["detector_arm"].move(0.0, 20.0, **speed(20))
    axes["detector_arm"].stop(15.0, deceleration_deg_s2=1e4)
    assert watch.look(100.0) is None


def test_a_motion_that_begins_before_one_that_waits_is_looked_at(arms):
    watch, axes = arms
    axes["detector_arm"].move(50.0, 10.0, **speed(20))
    axes["detector_arm"].move(90.0, 40.0, **speed(20))
    axes["source_arm"].move(-60.0, 20.0, **speed(20))
    axes["source_arm"].move(0.0, 30.0, **speed(20))
    contact = watch.look(100.0)
    assert contact.parts == "source arm and detector arm"
    assert 20.0 < contact.time_s < 24.0


def test_of_ever_so_many_motions_none_is_forgotten(arms):
    watch, axes = arms
    for number in range(200):
        axes["detector_arm"].move(50.0 if number % 2 else 90.0, 10.0 * number, **speed(20))
        if number == 3:
            axes["detector_arm"].move(0.0, 10.0 * number + 5.0, **speed(20))
    assert watch.look(1e4) is not None
    assert 30.0 < watch.contact.time_s < 45.0


def test_arms_at_rest_next_to_each_other_cost_no_looks(arms):
    watch, axes = arms
    axes["detector_arm"].move(11.001, 10.0, **speed(20))
    assert watch.look(1e6) is None
