"""An unmodified RunEngine of Bluesky scans the simulated bench; what it is told is true, and what it ends stands."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack
from hashlib import sha256
from pathlib import Path

import bluesky.plan_stubs as bps
import bluesky.plans as bp
import event_model
import pytest
import yaml
from bluesky import RunEngine, protocols
from bluesky.preprocessors import run_decorator
from bluesky.utils import FailedStatus, RunEngineInterrupted
from numpy.testing import assert_allclose

import goniometer.bluesky
from drivers.clock import Deadline
from goniometer.bench import served_ports, simulate
from goniometer.errors import (
    CollisionError,
    ConfigurationError,
    DeviceFaultError,
    GoniometerError,
    LimitError,
    PositionError,
    ScanInterrupted,
)
from sim_devices.faults.known import one_fault
from sim_devices.serving.control import ControlServer

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "scenes" / "iron_noise_free.yaml"
START_DEG = {"source_arm": 40.0, "detector_arm": 20.0}


class Documents:
    """What a RunEngine has said, each document valid."""

    def __init__(self):
        self.heard = []

    def __call__(self, kind, document):
        event_model.schema_validators[event_model.DocumentNames[kind]].validate(document)
        self.heard.append((kind, document))

    def of(self, kind):
        return [document for other, document in self.heard if other == kind]

    def column(self, field):
        return [event["data"][field] for event in self.of("event")]


@pytest.fixture
def RE():
    engine = RunEngine()
    yield engine
    if engine.state not in ("idle", "panicked"):
        engine.halt()
    engine.loop.call_soon_threadsafe(engine.loop.stop)
    engine._th.join()
    engine.loop.close()


@pytest.fixture
def documents(RE):
    heard = Documents()
    RE.subscribe(heard)
    return heard


@pytest.fixture
def bench():
    with goniometer.bluesky.devices(SCENE, speed="max", wavelength_nm=550, exposure_s=0.03) as opened:
        yield opened


class Served:
    """A bench served as another process would, its rig file, and what is true there."""

    def __init__(self, setup, folder, speed, stack):
        self.sim = stack.enter_context(simulate(setup.scene, speed))
        control = ControlServer(self.sim, setup.scene_text)
        stack.callback(control.stop)
        rig = yaml.safe_load(setup.rig_text) | {"bench": control.address}
        for name, port in served_ports(setup.rig, self.sim).items():
            rig["devices"][name]["port"] = port
        self.path = folder / "bench.yaml"
        self.path.write_text(yaml.safe_dump(rig))

    def true_deg(self, role):
        return self.sim.world.axes[role].motor_deg(self.sim.clock.now())

    def is_moving(self):
        return any(axis.is_moving(self.sim.clock.now()) for axis in self.sim.world.axes.values())


@pytest.fixture
def served(load, tmp_path):
    with ExitStack() as stack:
        yield lambda speed="max", zones=(), **more: Served(
            load({}, {}, zones, start_deg=START_DEG, **more), tmp_path, speed, stack
        )


def test_the_devices_are_what_the_run_engine_asks_for(bench):
    for axis in (bench.source_arm, bench.detector_arm, bench.sample_azimuth, bench.analyzer):
        for protocol in ("Movable", "Readable", "Locatable", "Checkable", "Stoppable", "Configurable", "HasHints"):
            assert isinstance(axis, getattr(protocols, protocol)), protocol
    for protocol in ("Triggerable", "Readable", "Configurable", "HasHints"):
        assert isinstance(bench.detector, getattr(protocols, protocol)), protocol
    status = bench.detector.trigger()
    assert isinstance(status, protocols.Status)
    status.wait(10)
    assert status.done
    assert status.success


def test_a_grid_scan_reads_what_the_bench_shows_where_it_shows_it(RE, documents, bench):
    arm, analyzer = bench.detector_arm, bench.analyzer
    RE(bps.mv(bench.source_arm, 60))
    RE(bp.grid_scan([bench.detector, bench.source_arm], arm, 20, 60, 3, analyzer, 2, 6, 5, snake_axes=True))
    assert [kind for kind, _ in documents.heard] == ["start", "descriptor", *["event"] * 15, "stop"]
    assert documents.of("stop")[0]["exit_status"] == "success"
    assert_allclose(documents.column("detector_arm"), [20] * 5 + [40] * 5 + [60] * 5, atol=0.005)
    assert_allclose(documents.column("source_arm"), 60, atol=0.005)
    assert documents.column("analyzer") == [2, 3, 4, 5, 6, 6, 5, 4, 3, 2, 2, 3, 4, 5, 6]
    assert_allclose(documents.column("analyzer_angle")[:5], [0, 45, 90, 135, float("nan")])
    power_w = documents.column("detector")
    at_0, at_45, at_90, at_135, dark = power_w[10:]
    assert_allclose(at_0 + at_90, at_45 + at_135, rtol=2e-4)  # both are S0 behind ideal polarizers, dark added twice
    assert at_0 > at_90 > 10 * dark  # s-polarized, as a metal near the mirror direction is


def test_the_documents_say_what_everything_is(RE, documents, bench):
    RE(bp.count([bench.detector, bench.detector_arm, bench.analyzer], num=2))
    descriptor = documents.of("descriptor")[0]
    keys = descriptor["data_keys"]
    assert [keys[name].get("units") for name in ("detector", "detector_arm", "analyzer", "analyzer_angle")] == [
        "W",
        "deg",
        None,
        "deg",
    ]
    assert keys["detector_arm"]["limits"] == {"control": {"low": -85.0, "high": 85.0}}
    assert keys["detector_arm"]["source"] == "newport_esp301 arms"
    assert descriptor["hints"] == {name: {"fields": [name]} for name in ("detector", "detector_arm", "analyzer")}
    assert descriptor["configuration"]["detector"]["data"] == {
        "detector_exposure": 0.03,
        "detector_wavelength": 550.0,
    }
    slots = descriptor["configuration"]["analyzer"]["data"]
    assert list(slots.values()) == ["open", 0.0, 45.0, 90.0, 135.0, "blocked"]
    first, second = (event["timestamps"]["detector"] for event in documents.of("event"))
    assert second - first > 0.03


def test_relative_scans_come_back(RE, documents, bench):
    RE(bps.mv(bench.detector_arm, 30))
    RE(bp.rel_scan([bench.detector], bench.detector_arm, -2, 2, 3))
    assert_allclose(documents.column("detector_arm"), [28, 30, 32], atol=0.005)
    assert_allclose(list(bench.detector_arm.locate().values()), 30, atol=0.005)


def test_what_is_set_together_moves_together(RE, bench):
    def duration_s(plan):
        begun_s = bench.clock.now()
        RE(plan)
        return bench.clock.now() - begun_s

    one_s = duration_s(bps.mv(bench.source_arm, 60))
    three_s = duration_s(bps.mv(bench.source_arm, 0, bench.detector_arm, 60, bench.analyzer, 3))
    assert 3.2 < one_s < 3.6  # 60 degrees at 20 degrees/s, and 0.25 s to get there and to stop
    assert three_s < one_s + 0.1


def think():
    """What a slow plan does: real time passes for all other threads, and the bench hears nothing."""
    sha256(bytes(20_000_000))


def test_virtual_time_does_not_pass_while_a_plan_thinks(RE, documents, bench):
    @run_decorator()
    def plan():
        yield from bps.abs_set(bench.source_arm, 60, group="arms")
        think()
        yield from bps.abs_set(bench.detector_arm, 60, group="arms")
        yield from bps.trigger_and_read([bench.source_arm, bench.detector_arm])
        yield from bps.trigger(bench.detector, wait=True)
        think()
        yield from bps.create()
        yield from bps.read(bench.source_arm)
        think()
        yield from bps.read(bench.detector_arm)
        yield from bps.save()
        yield from bps.wait("arms")

    RE(plan())
    source_deg, detector_deg = documents.column("source_arm"), documents.column("detector_arm")
    assert_allclose(source_deg, detector_deg, atol=1.0)
    assert 0 < source_deg[1] - source_deg[0] < 4


def test_an_axis_has_settled_when_it_is_said_to_have_arrived(served):
    there, said_s = served(), []
    with goniometer.bluesky.devices(there.path) as bench:
        status = bench.source_arm.set(60)
        status.add_callback(lambda status: said_s.append(there.sim.clock.now()))
        status.wait(10)
    assert 0.05 <= said_s[0] - there.sim.world.axes["source_arm"].end_s < 0.15  # settle_s in the rig file


def test_virtual_time_passes_alike_each_time(RE):
    def duration_s():
        with goniometer.bluesky.devices(SCENE, speed="max") as bench:
            RE(bp.grid_scan([bench.detector], bench.detector_arm, 0, 4, 3, bench.analyzer, 2, 4, 3, snake_axes=True))
            return bench.clock.now()

    assert_allclose(duration_s(), duration_s(), atol=1e-6)


@pytest.mark.parametrize(
    ("order", "kind", "message"),
    [
        (lambda bench: (bench.detector_arm, 86), LimitError, "the target 86 degrees is outside the limits -85 to 85"),
        (lambda bench: (bench.analyzer, 7), LimitError, "slot 7 does not exist; the rig file has the slots 1, 2, 3"),
        (lambda bench: (bench.analyzer, 2.5), LimitError, "slot 2.5 does not exist"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_sent(RE, bench, order, kind, message):
    device, value = order(bench)
    before, begun_s = device.read(), bench.clock.now()
    with pytest.raises(kind, match=message):
        device.check_value(value)
    assert bench.clock.now() == begun_s
    with pytest.raises(FailedStatus, match=message) as failed:
        RE(bps.mv(device, value))
    assert isinstance(failed.value.__cause__, kind)
    assert device.read()[device.name]["value"] == before[device.name]["value"]


def test_a_collision_is_refused_and_nothing_moves(RE, documents, served):
    there = served(
        zones=[{"arms_closer_than_deg": 10}],
        bodies={"source_arm_half_deg": 4, "detector_arm_half_deg": 4, "frame_deg": 100},
    )
    with goniometer.bluesky.devices(there.path) as bench:
        with pytest.raises(FailedStatus, match="enters a collision zone") as failed:
            RE(bp.scan([bench.detector], bench.detector_arm, 20, -60, 3))
        assert isinstance(failed.value.__cause__, CollisionError)
        assert_allclose(documents.column("detector_arm"), [20, -20], atol=0.005)
        assert_allclose(there.true_deg("detector_arm"), -20, atol=0.005)
    assert documents.of("stop")[0]["exit_status"] == "fail"
    # the simulated bench complains on leaving when parts have touched


def on_the_way(bench):
    """Send an arm off, and take a reading while it moves."""
    yield from bps.abs_set(bench.detector_arm, 80, group="arm")
    yield from bps.trigger_and_read([bench.detector, bench.detector_arm])


def test_an_error_in_a_plan_stops_the_bench(RE, documents, served):
    there = served()

    @run_decorator()
    def plan(bench):
        yield from on_the_way(bench)
        raise ZeroDivisionError("somebody's plan")

    with goniometer.bluesky.devices(there.path) as bench:
        with pytest.raises(ZeroDivisionError, match="somebody's plan"):
            RE(plan(bench))
        stood_deg = bench.detector_arm.read()["detector_arm"]["value"]
        assert 20 < stood_deg < 40
        RE(bps.mv(bench.source_arm, 30))
        assert bench.detector_arm.read()["detector_arm"]["value"] - stood_deg < 3  # 2.5 degrees to come to rest
    assert documents.of("stop")[0]["exit_status"] == "fail"


@pytest.mark.parametrize("ending", ["abort", "stop", "halt"])
def test_an_interrupted_plan_leaves_the_bench_standing(RE, documents, served, ending):
    there = served()

    @run_decorator()
    def plan(bench):
        yield from on_the_way(bench)
        yield from bps.pause()

    with goniometer.bluesky.devices(there.path) as bench:
        with pytest.raises(RunEngineInterrupted):
            RE(plan(bench))
        getattr(RE, ending)()
    assert not there.is_moving()
    assert 20 < there.true_deg("detector_arm") < 40
    assert documents.of("stop")[0]["exit_status"] == ("success" if ending == "stop" else "abort")


def test_after_a_pause_the_plan_goes_on_where_it_was(RE, documents, served):
    there = served()

    @run_decorator()
    def plan(bench):
        yield from bps.checkpoint()
        yield from on_the_way(bench)
        yield from bps.pause()
        yield from bps.wait("arm")
        yield from bps.trigger_and_read([bench.detector, bench.detector_arm])

    with goniometer.bluesky.devices(there.path) as bench:
        with pytest.raises(RunEngineInterrupted):
            RE(plan(bench))
        assert there.true_deg("detector_arm") < 40
        RE.resume()
    assert_allclose(documents.column("detector_arm")[-1], 80, atol=0.06)
    assert documents.of("stop")[0]["exit_status"] == "success"


def test_stopping_with_an_error_fails_the_status(served):
    with goniometer.bluesky.devices(served(speed=1.0).path) as bench:
        status = bench.detector_arm.set(80)
        bench.detector_arm.stop(success=False)
        with pytest.raises(PositionError, match="detector_arm: it was told to stop on its way"):
            status.wait(10)
        status = bench.detector_arm.set(80)
        bench.detector_arm.stop()
        status.wait(10)
        assert bench.detector_arm.read()["detector_arm"]["value"] < 40


def let_pass_s(bench, duration_s):
    """Let real time pass as the bench does: with a reading."""
    bench.detector.configure({"exposure_s": duration_s})
    bench.detector.trigger().wait(10)


def test_orders_for_one_device_wait_for_each_other(served):
    """The table's drive refuses a move while it moves, also while it brakes."""
    there = served(speed=1.0)
    with goniometer.bluesky.devices(there.path) as bench:
        table = bench.sample_azimuth
        off = table.set(60)
        let_pass_s(bench, 0.3)
        table.stop()
        assert off.success
        back, on = table.set(0), table.set(2)
        on.wait(10)
        assert back.success
        assert_allclose(there.true_deg("sample_azimuth"), 2, atol=0.06)
        detector = [bench.detector.trigger() for _ in range(3)]
        detector[-1].wait(10)
        assert all(status.success for status in detector)


def test_leaving_the_block_stops_the_bench_and_refuses_the_rest(served):
    there, kept = served(speed=1.0), []

    def press_ctrl_c_on_the_way():
        with goniometer.bluesky.devices(there.path) as bench:
            kept.extend([bench, bench.detector_arm.set(80)])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        press_ctrl_c_on_the_way()
    bench, status = kept
    assert not there.is_moving()
    assert there.true_deg("detector_arm") < 60
    with pytest.raises(GoniometerError, match="The bench is not open any more"):
        status.wait(10)
    with pytest.raises(GoniometerError, match=r"not open any more \(it was left\)"):
        bench.detector_arm.read()
    with pytest.raises(GoniometerError, match="not open any more"):
        bench.detector_arm.set(0).wait(10)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
def test_sigterm_stops_the_bench_in_the_middle_of_a_plan(RE, documents, served):
    there = served(speed=1.0)
    RE.waiting_hook = lambda statuses: os.kill(os.getpid(), signal.SIGTERM) if statuses else None
    with (
        pytest.raises(ScanInterrupted, match="SIGTERM"),
        goniometer.bluesky.devices(there.path) as bench,
    ):
        RE(bp.scan([bench.detector], bench.detector_arm, 80, 85, 2))
    assert not there.is_moving()
    assert there.true_deg("detector_arm") < 60
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_second_ctrl_c_does_not_keep_the_bench_from_being_stopped(served, monkeypatch):
    there, join, interruptions = served(speed=1.0), threading.Thread.join, [KeyboardInterrupt]

    def interrupted_join(thread, timeout=None):
        if thread.name == "bench" and interruptions:
            raise interruptions.pop()
        join(thread, timeout)

    monkeypatch.setattr(threading.Thread, "join", interrupted_join)

    def leave_on_the_way():
        with goniometer.bluesky.devices(there.path) as bench:
            bench.detector_arm.set(80)
            let_pass_s(bench, 0.3)

    with pytest.raises(KeyboardInterrupt):
        leave_on_the_way()
    assert not interruptions
    assert not there.is_moving()
    assert "bench" not in [thread.name for thread in threading.enumerate()]


def test_a_session_that_is_left_without_leaving_the_block_stops_the_bench(served):
    there = served(speed=1.0)
    session = (
        "import sys, contextlib, goniometer.bluesky\n"
        "stack = contextlib.ExitStack()\n"
        "bench = stack.enter_context(goniometer.bluesky.devices(sys.argv[1], exposure_s=0.3))\n"
        "bench.detector_arm.set(80)\n"
        "bench.detector.trigger().wait()\n"
    )
    subprocess.run([sys.executable, "-c", session, there.path], check=True)
    assert not there.is_moving()
    assert there.true_deg("detector_arm") < 60


@pytest.mark.parametrize(
    ("fault", "kind", "message"),
    [
        ({"fault": "stall", "axis": "detector_arm"}, DeviceFaultError, "detector_arm: the axis has stood still at"),
        ({"fault": "limit_hit", "axis": "detector_arm"}, DeviceFaultError, "error 204, positive hardware limit"),
        ({"fault": "reset_in_motion", "axis": "detector_arm"}, DeviceFaultError, "the motor is off"),
        ({"fault": "reset_in_motion", "axis": "sample_azimuth"}, PositionError, "stands at .* after a move to 60"),
        ({"fault": "detector_saturated", "for_s": 60}, DeviceFaultError, "meter: the detector was saturated"),
        ({"fault": "cable_pulled", "device": "meter"}, ConnectionError, "meter: the link on port"),
    ],
)
def test_a_device_that_fails_fails_the_plan_with_its_own_words(
    RE, documents, served, monkeypatch, fault, kind, message
):
    monkeypatch.setattr(Deadline, "_REAL_GRACE_S", 0.0)
    there = served(faults=[{"at_s": 1.0} | fault])
    with goniometer.bluesky.devices(there.path) as bench:
        bench.detector.trigger().wait(10)
        with pytest.raises(FailedStatus, match=message) as failed:
            RE(bp.scan([bench.detector], bench.detector_arm, 40, 80, bench.sample_azimuth, 40, 80, 3))
        assert isinstance(failed.value.__cause__, kind)
        if failed.value.__cause__.device == "meter":
            with pytest.raises(GoniometerError, match="nothing was read yet"):
                bench.detector.read()
    assert documents.of("stop")[0]["exit_status"] == "fail"
    assert not there.is_moving()


def test_an_arm_that_was_moved_meanwhile_is_not_moved_on(RE, served):
    there = served()
    with goniometer.bluesky.devices(there.path) as bench:
        RE(bps.mv(bench.detector_arm, 40))
        there.sim.faults.switch_on(one_fault.validate_python({"fault": "lost_home", "axis": "detector_arm"}))
        with pytest.raises(FailedStatus, match="stands at 0 degrees although it was left at 40 degrees"):
            RE(bps.mv(bench.detector_arm, 50))
        assert_allclose(there.true_deg("detector_arm"), 40, atol=0.005)


def test_the_exposure_is_changed_and_said_by_the_usual_message(RE, documents, bench):
    @run_decorator()
    def plan():
        yield from bps.trigger_and_read([bench.detector])
        yield from bps.configure(bench.detector, {"exposure_s": 0.301})
        yield from bps.trigger_and_read([bench.detector])

    begun_s = bench.clock.now()
    RE(plan())
    assert bench.clock.now() - begun_s > 0.33
    exposures_s = [
        each["configuration"]["detector"]["data"]["detector_exposure"] for each in documents.of("descriptor")
    ]
    assert_allclose(exposures_s, [0.03, 0.3])  # whole samples of 3 ms
    for settings in ({"gain": 1}, {"exposure_s": 0}, {"exposure_s": -1}, {"exposure_s": 10}):
        with pytest.raises(ConfigurationError, match=r"gain|is none|too long"):
            bench.detector.configure(settings)
    assert_allclose(bench.detector.read_configuration()["detector_exposure"]["value"], 0.3)


def test_nothing_is_read_that_was_not_taken(bench):
    with pytest.raises(GoniometerError, match="detector: nothing was read yet"):
        bench.detector.read()


def test_other_threads_may_ask_while_a_plan_runs(RE, documents, bench):
    asked, is_over = [], threading.Event()

    def ask():
        while not is_over.is_set():
            asked.append((bench.source_arm.read()["source_arm"]["value"], bench.analyzer.read()["analyzer"]["value"]))

    other = threading.Thread(target=ask)
    other.start()
    try:
        RE(bp.scan([bench.detector], bench.detector_arm, 0, 20, 11))
    finally:
        is_over.set()
        other.join()
    assert len(asked) > 10
    assert set(asked) == {asked[0]}
    assert_allclose(documents.column("detector_arm"), range(0, 21, 2), atol=0.005)


def test_stages_that_forget_their_zero_are_homed_first(RE, documents):
    with goniometer.bluesky.devices(ROOT / "scenes" / "iron_thorlabs.yaml", speed="max") as bench:
        with pytest.raises(FailedStatus, match="the stage does not know where its zero is"):
            RE(bps.mv(bench.detector_arm, 10))
        bench.home()
        RE(bp.scan([bench.detector], bench.detector_arm, 10, 20, bench.analyzer, 1, 4, 2))
    assert_allclose(documents.column("analyzer_angle"), [0, 135])


def test_what_is_not_a_bench_is_refused(served, tmp_path, monkeypatch):
    with (
        pytest.raises(ConfigurationError, match="this is a recipe, and a rig or a scene is needed"),
        goniometer.bluesky.devices(ROOT / "recipes" / "iron_60deg.yaml"),
    ):
        pass
    with (
        pytest.raises(ConfigurationError, match="speed 3 cannot be kept"),
        goniometer.bluesky.devices(served().path, speed=3),
    ):
        pass
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with (
        pytest.raises(ConfigurationError, match=r"pip install 'goniometer\[bluesky\]'"),
        goniometer.bluesky.devices(SCENE),
    ):
        pass


def test_the_core_does_without_bluesky():
    code = (
        "import sys; sys.modules['bluesky'] = sys.modules['event_model'] = None\n"
        "import goniometer.cli, goniometer.bluesky, acquisition.event_model"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_example_runs_as_it_is_written():
    example = (ROOT / "docs" / "bluesky.md").read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    command = [sys.executable, "-W", "error", "-c", example]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    kinds = [line.split(maxsplit=1)[0] for line in done.stdout.splitlines()]
    assert kinds == ["start", "descriptor", *["event"] * 20, "stop"]
