"""Cables are pulled and plugged in again while a scan runs, on benches of every make: its readings stay the same."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

import pytest
from numpy.testing import assert_allclose

from acquisition.engine import Engine, stopped_afterwards
from acquisition.events import LinkRestored, ReadingStored
from acquisition.expand import Step, Target
from acquisition.journal import Journal
from acquisition.readings import Reading
from acquisition.time_left import TimeLeft
from drivers.wire.link import Link
from goniometer.assembly import connected
from goniometer.bench import simulate
from goniometer.errors import DeviceFaultError, NotConnectedError, PositionError
from sim_devices.faults.known import one_fault

FOUR = {1: 0, 2: 45, 3: 90, 4: 135}
NOISE = {"read_w": 2e-11, "shot": True}
BY_HAND = {"settle_s": 0.05, "tolerance_deg": 0.06}


def axis(limit_deg=85, speed=20, acceleration=80, **more):
    known = {"limits_deg": [-limit_deg, limit_deg], "velocity_deg_s": speed, "acceleration_deg_s2": acceleration}
    return known | BY_HAND | more


def line_of_drives(framing):
    """Three drives of two makes on one line, or behind one gateway."""
    line = {"framing": framing, "line": "rs485"}
    drive = {"driver": "oriental_az", "baudrate": 38400, "parity": "none"}
    table = axis(180, acceleration=400, home_at_start=True)
    rig = {
        "arms": None,
        "source": drive | {"unit": 1, "axes": {"source_arm": axis(steps_per_deg=50)}},
        "detector": drive | {"unit": 2, "axes": {"detector_arm": axis(steps_per_deg=50)}},
        "stage": {"driver": "smc_lec", "unit": 3, "axes": {"sample_azimuth": table}},
    }
    scene = {
        "arms": None,
        "source": line | {"type": "oriental_az", "unit": 1, "axis": "source_arm", "step_deg": 0.02},
        "detector": line | {"type": "oriental_az", "unit": 2, "axis": "detector_arm", "step_deg": 0.02},
        "stage": line | {"type": "smc_lec", "unit": 3, "axis": "sample_azimuth"},
    }
    return rig, scene


def apt():
    """Arms on two bays of a rack, and the sample on a controller of its own."""
    bays = {role: axis(bay=bay, home_at_start=True) for bay, role in ((1, "source_arm"), (2, "detector_arm"))}
    servo = axis(180, acceleration=25, home_at_start=True)
    rig = {
        "arms": {"driver": "thorlabs_apt", "stage": "HDR50", "axes": bays},
        "stage": {"driver": "thorlabs_apt", "stage": "PRM1Z8", "axes": {"sample_azimuth": servo}},
    }
    scene = {
        "arms": {"type": "thorlabs_apt", "stage": "HDR50", "axes": {1: "source_arm", 2: "detector_arm"}},
        "stage": {"type": "thorlabs_apt", "stage": "PRM1Z8", "axes": {1: "sample_azimuth"}},
    }
    return rig, scene


def elliptec():
    """A rotator under the sample and a slider of polarizers on one bus."""
    module, served = {"address": "1", "slots": FOUR}, {"line": "elliptec"}
    turning = axis(180, 300, 8600, home_at_start=True, tolerance_deg=0.1)
    rig = {
        "stage": {"driver": "thorlabs_elliptec", "address": "2", "axes": {"sample_azimuth": turning}},
        "analyzer": module | {"driver": "thorlabs_elliptec_slider", "slot_s": 0.6, "settle_s": 0.05},
    }
    scene = {
        "stage": served | {"type": "thorlabs_elliptec", "model": "ELL18", "address": "2", "axis": "sample_azimuth"},
        "analyzer": served | module | {"type": "thorlabs_elliptec_slider"},
    }
    return rig, scene


def rotator():
    """A polarizer that an ELL14 turns."""
    turning = axis(180, 400, 8600, home_at_start=True, tolerance_deg=0.1)
    rig = {
        "rotator": {"driver": "thorlabs_elliptec", "axes": {"polarizer": turning}},
        "analyzer": {"driver": "rotating_polarizer", "slots": FOUR},
    }
    scene = {
        "rotator": {"type": "thorlabs_elliptec", "axis": "polarizer"},
        "analyzer": {"type": "rotating_polarizer"},
    }
    return rig, scene


def lock_in():
    """A lock-in as detector."""
    filtering = {"time_constant_s": 0.01, "slope_db": 12, "responsivity_v_per_w": 2e5}
    rig = {"meter": filtering | {"driver": "stanford_sr830", "sample_s": 0.04, "noise": NOISE}}
    scene = {"meter": {"type": "stanford_sr830", "acceptance_sr": 1e-4, "volts_per_watt": 2e5}}
    return rig, scene


BENCHES = {
    "wheel": ({}, {}),
    "drives, RTU": line_of_drives("rtu"),
    "drives, gateway": line_of_drives("tcp"),
    "APT": apt(),
    "Elliptec bus": elliptec(),
    "rotator": rotator(),
    "lock-in": lock_in(),
}
STEPS = [
    Step(point, "signal", Target(30.0, exit_deg, 15.0, slot), None, 2, 0.03, 1.0)
    for point, exit_deg in enumerate((20.0, 10.0))
    for slot in (2, 3)
]


class ImpatientLink(Link):
    """A link whose driver waits for an answer for a tenth of a second: the simulated bench takes a thousandth."""

    def __init__(self, port, **options):
        super().__init__(port, **options | {"reply_timeout_s": 0.1})


@dataclass
class Scan:
    """What a scan has stored and told."""

    rows: tuple[Reading, ...]
    events: list[object]
    duration_s: float

    @property
    def restored(self):
        return [event for event in self.events if isinstance(event, LinkRestored)]


@pytest.fixture(autouse=True)
def no_real_grace(monkeypatch):
    monkeypatch.setattr("drivers.clock.Deadline._REAL_GRACE_S", 0.0)


@pytest.fixture
def scan(load, tmp_path):
    """Scan on a bench of this setup; `act` is called between any two waits with the bench and the time of the scan."""
    journals = iter(range(1000))

    def run(rig, scene, act=lambda bench, time_s: None, ports=over_tcp):
        setup, events = load(rig, scene), []
        names = [name for name, device in setup.rig.devices.items() if device.port]
        with (
            simulate(setup.scene, "max") as bench,
            connected(setup.rig, ports(bench, names), bench.clock, 550.0) as devices,
            Journal.create(tmp_path / f"journal {next(journals)}", {}) as journal,
        ):
            begun_s = None

            def check():
                if begun_s is not None:
                    act(bench, bench.clock.now() - begun_s)

            engine = Engine(devices, bench.clock, journal, events.append, check, TimeLeft(bench.clock, 60.0))
            try:
                with stopped_afterwards(devices, bench.clock):
                    engine.home()
                    begun_s = bench.clock.now()
                    engine.run(STEPS)
            finally:
                rows, duration_s = journal.readings(), bench.clock.now() - begun_s
                shown = [event.reading for event in events if isinstance(event, ReadingStored)]
                assert list(rows) == shown
                assert not any(turned.velocity_deg_s(bench.clock.now()) for turned in bench.world.axes.values())
            return Scan(rows, events, duration_s)

    return run


def over_tcp(bench, names):
    return {name: bench.addresses[name].tcp for name in names}


def at_terminals(bench, names):
    return {name: bench.addresses[name].pty for name in names}


def once(time_s, *faults):
    """Let faults strike at a time of the scan."""
    left = [faults]

    def act(bench, now_s):
        if left and now_s >= time_s:
            for fault in left.pop():
                bench.faults.switch_on(one_fault.validate_python(fault))

    return act


def pulled(device, for_s=1.7):
    return {"fault": "cable_pulled", "device": device, "for_s": for_s}


def off(device, off_s=0.5):
    return {"fault": "power_cycle", "device": device, "off_s": off_s}


def require_same(scan, expected):
    """The same readings, each once: exactly, but for angles within tolerance and what a lock-in or a rotator adds."""
    assert [place(row) for row in scan.rows] == [place(row) for row in expected.rows]
    angles = [[(row.incidence_deg, row.exit_deg, row.azimuth_deg) for row in each.rows] for each in (scan, expected)]
    assert_allclose(*angles, atol=0.1)
    power_w = [[row.power_w for row in each.rows] for each in (scan, expected)]
    assert_allclose(*power_w, rtol=5e-3)


def place(row):
    return row.point, row.kind, row.repeat, row.slot, row.exposure_s


@pytest.mark.parametrize("which", BENCHES)
def test_a_cable_pulled_at_any_moment_costs_time_and_no_reading(scan, load, which):
    rig, scene = BENCHES[which]
    expected = scan(rig, scene)
    names = [name for name, device in load(rig, scene).rig.devices.items() if device.port]
    restored = 0
    for number in range(2 * len(names)):
        name = names[number % len(names)]
        found = scan(rig, scene, once(expected.duration_s * (number + 0.5) / (2 * len(names)), pulled(name)))
        require_same(found, expected)
        assert len(found.restored) <= 2
        restored += bool(found.restored)
    assert restored > len(names)


def test_what_a_person_is_told(scan):
    (event,) = scan({}, {}, once(1.0, pulled("arms", for_s=2.0))).restored
    assert re.fullmatch(
        r"arms: the link on port socket://\S+ is gone \(.*\) at \d\d:\d\d:\d\d and back after 3\.\d s; all devices are "
        "as they were, and what was under way is done again",
        str(event),
    )


def test_a_cable_that_stays_out_ends_the_scan_and_names_its_device(scan):
    with pytest.raises(BaseExceptionGroup) as caught:
        scan({}, {}, once(1.0, pulled("arms", for_s=1e6)))
    lost, *unseen = caught.value.exceptions
    assert isinstance(lost, NotConnectedError)
    assert lost.device == "arms"
    assert lost.__notes__[0].startswith("It was tried for 30 s to connect again, at last in vain: ")
    assert {failure.device for failure in unseen} == {"source_arm", "detector_arm"}
    assert all("may still be moving" in str(failure) for failure in unseen)


@pytest.mark.parametrize("name", ["arms", "stage", "analyzer", "meter"])
def test_a_line_without_a_word_for_seconds_is_as_good_as_pulled(scan, monkeypatch, name):
    """At a terminal a pulled cable is silence: nothing hangs up."""
    for module in ("goniometer.rig_devices.connecting", "drivers.modbus.port"):
        monkeypatch.setattr(f"{module}.Link", ImpatientLink)
    expected = scan({}, {}, ports=at_terminals)
    found = scan({}, {}, once(0.35 * expected.duration_s, pulled(name, 3.0)), at_terminals)
    require_same(found, expected)
    assert found.restored or name == "analyzer", "a wheel is waited for, as long as it may turn"


@pytest.mark.parametrize(
    ("which", "device", "message"),
    [
        ("wheel", "arms", r"_arm: the motor is off: its controller was reset.* axis was not set up again"),
        ("APT", "arms", "_arm: the stage does not know where its zero is: it was switched off"),
        ("drives, RTU", "stage", "sample_azimuth: its servo is off"),
        ("Elliptec bus", "stage", "sample_azimuth: the stage does not know where its zero is: it was switched off"),
    ],
)
def test_a_stage_that_comes_back_without_its_home_is_not_moved_any_more(scan, which, device, message):
    true_deg = []

    def act(bench, time_s):
        strike(bench, time_s)
        if time_s > 2.5:
            true_deg.append([turned.motor_deg(bench.clock.now()) for turned in bench.world.axes.values()])

    strike = once(2.0, pulled(device, for_s=3.0), off(device))
    with pytest.raises(DeviceFaultError, match=message) as caught:
        scan(*BENCHES[which], act)
    assert re.match("It came to light when all devices were checked, after this: .* is gone", caught.value.__notes__[0])
    assert_allclose(true_deg, [true_deg[0]] * len(true_deg), atol=1e-9)


@pytest.mark.parametrize("device", ["stage", "analyzer", "meter"])
def test_what_needs_no_home_is_set_up_again_when_it_was_switched_off_too(scan, device):
    expected = scan({}, {})
    for share in (0.15, 0.5, 0.8):
        found = scan({}, {}, once(share * expected.duration_s, pulled(device, for_s=3.0), off(device)))
        require_same(found, expected)
        assert found.restored


class Adapters:
    """USB adapters: files that lead to the terminals of a bench's devices, and nowhere while they are unplugged."""

    def __init__(self, folder, links):
        self._folder, self._links = folder, links
        self._terminals = {}

    def ports(self, bench, names):
        self._terminals = at_terminals(bench, names)
        for name in names:
            self.plug_in(name, name)
        return {name: str(self._folder / name) for name in names}

    def plug_in(self, name, device):
        (self._folder / name).symlink_to(self._terminals[device])

    def unplug(self, name):
        """Take its file away, and leave the driver with a terminal that has been hung up."""
        path = self._folder / name
        path.unlink()
        (link,) = (link for link in self._links if link.port == str(path))
        controller, terminal = os.openpty()
        os.close(controller)
        os.dup2(terminal, link.fileno())
        os.close(terminal)


@pytest.fixture
def replugged(tmp_path, monkeypatch):
    """What to give to a scan whose USB adapters are unplugged after 2 s and, 1.5 s later, lead to these devices."""
    links, folders = [], iter(range(1000))

    class KeptLink(Link):
        def __init__(self, port, **options):
            super().__init__(port, **options)
            links.append(self)

    for module in ("goniometer.rig_devices.connecting", "drivers.modbus.port"):
        monkeypatch.setattr(f"{module}.Link", KeptLink)

    def make(device_behind):
        folder = tmp_path / f"dev {next(folders)}"
        folder.mkdir()
        adapters = Adapters(folder, links)
        left = [(3.5, adapters.plug_in), (2.0, lambda name, _: adapters.unplug(name))]

        def act(bench, time_s):
            if left and time_s >= left[-1][0]:
                _, do = left.pop()
                for name, device in device_behind.items():
                    do(name, device)

        return {"act": act, "ports": adapters.ports}

    return make


@pytest.mark.parametrize("name", ["arms", "stage", "analyzer", "meter"])
def test_a_usb_adapter_that_the_system_finds_again_goes_on(scan, replugged, name):
    expected = scan({}, {}, **replugged({}))
    found = scan({}, {}, **replugged({name: name}))
    require_same(found, expected)
    (event,) = found.restored
    assert 1.0 < event.away_s < 4.0


def test_two_cables_that_were_exchanged_are_noticed_by_where_the_arms_stand(scan, replugged):
    """Drives of this make have no number by which to tell them apart."""
    drive = {"driver": "oriental_az", "unit": 1}
    simulated = {"type": "oriental_az", "unit": 1, "step_deg": 0.02}
    arms = {"source": "source_arm", "detector": "detector_arm"}
    rig = {name: drive | {"axes": {role: axis(steps_per_deg=50)}} for name, role in arms.items()}
    scene = {name: simulated | {"axis": role} for name, role in arms.items()}
    with pytest.raises(PositionError, match="detector_arm: after its link was lost it stands at 30 degrees"):
        scan(rig | {"arms": None}, scene | {"arms": None}, **replugged({"source": "detector", "detector": "source"}))
