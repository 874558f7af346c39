"""Faults of devices behind a Modbus TCP gateway, or on a line with others: they strike one, and the others go on."""

import pytest
from pydantic import ValidationError

from goniometer.errors import ConfigurationError
from sim_devices.bench import Bench
from sim_devices.faults.known import one_fault
from sim_devices.modbus.rtu import crc16
from sim_devices.serving.clock import VirtualClock

ALARM = "03 00 80 00 02"
HOMED = "02 00 4A 00 01"


def az(unit, axis, **more):
    return {"type": "oriental_az", "unit": unit, "axis": axis, "step_deg": 0.02} | more


def lec(unit, **more):
    return {"type": "smc_lec", "unit": unit, "axis": "sample_azimuth"} | more


def drives(framing):
    """Three drives on one line."""
    line = {"framing": framing, "line": "rs485"}
    return {"source": az(1, "source_arm", **line), "detector": az(2, "detector_arm", **line), "stage": lec(3, **line)}


def modules(first, second):
    """A rotator and a slider on one line."""
    return {
        "stage": {"type": "thorlabs_elliptec", "address": first, "axis": "sample_azimuth", "line": "bus"},
        "analyzer": {
            "type": "thorlabs_elliptec_slider",
            "address": second,
            "slots": {1: 0, 2: 45, 3: 90, 4: 135},
            "line": "bus",
        },
    }


@pytest.fixture
def start(scene_document, scene_with):
    """Start a bench in virtual time, with some of its devices replaced, or left out by None."""
    benches = []

    def start(**devices):
        devices = {name: entry for name, entry in (scene_document["devices"] | devices).items() if entry}
        benches.append(Bench(scene_with(devices=devices), VirtualClock()))
        benches[-1].start()
        return benches[-1]

    yield start
    for bench in benches:
        bench.stop()


class Client:
    """Asks units, in the frames of their line."""

    def __init__(self, connection, framing):
        self._connection, self._framing = connection, framing

    def ask(self, unit, request):
        """The answer, from its function on, in hex."""
        message = bytes([unit]) + bytes.fromhex(request)
        if self._framing == "tcp":
            self._connection.sendall(bytes([0, 1, 0, 0, 0, len(message)]) + message)
            return self._connection.recv(300)[7:].hex(" ")
        self._connection.sendall(message + crc16(message))
        return self._connection.recv(300)[1:-2].hex(" ")


def switch_on(bench, name, **keys):
    bench.faults.switch_on(one_fault.validate_python({"fault": name, **keys}))
    bench.clock.sleep(0.1)


@pytest.fixture
def gateway(start, connect):
    """A bench whose sample stage is a drive behind a gateway, and a client of that."""

    def open_bench(drive):
        bench = start(sample_stage=drive)
        return bench, Client(connect(bench.addresses["sample_stage"]), "tcp")

    return open_bench


def test_a_gateway_says_of_a_drive_without_power_that_it_does_not_answer(gateway):
    bench, client = gateway(lec(1, framing="tcp"))
    client.ask(1, "05 00 30 FF 00")
    assert client.ask(1, "01 00 30 00 01") == "01 01 01"
    switch_on(bench, "power_cycle", device="sample_stage", off_s=5.0)
    before_s = bench.clock.now()
    assert client.ask(1, "01 00 30 00 01") == "81 0b"
    assert bench.clock.now() >= before_s + 1.0, "it has waited for the drive"
    bench.clock.sleep(5)
    assert client.ask(1, "01 00 30 00 01") == "01 01 00", "the drive has forgotten its coils"


@pytest.mark.parametrize(("name", "alarm"), [("limit_hit", "66"), ("lost_home", "4a")])
def test_a_drive_behind_a_gateway_has_the_alarms_of_any_other(gateway, name, alarm):
    bench, client = gateway(az(1, "sample_azimuth", framing="tcp"))
    assert client.ask(1, ALARM) == "03 04 00 00 00 00"
    switch_on(bench, name, axis="sample_azimuth")
    client.ask(1, "10 00 58 00 10 20" + "00 00 00 00 00 00 00 01 00 00 03 e8" + "00 00 03 e8" * 3 + "00 00 00 01" * 2)
    bench.clock.sleep(0.5)
    assert client.ask(1, ALARM) == f"03 04 00 00 00 {alarm}"


@pytest.mark.parametrize("framing", ["rtu", "tcp"])
def test_a_drive_that_loses_its_power_leaves_its_neighbours_alone(start, connect, framing):
    bench = start(arms=None, sample_stage=None, **drives(framing))
    client = Client(connect(bench.addresses["source"]), framing)
    client.ask(3, "05 00 30 FF 00")
    switch_on(bench, "power_cycle", device="stage", off_s=5.0)
    assert client.ask(1, ALARM) == client.ask(2, ALARM) == "03 04 00 00 00 00"
    bench.clock.sleep(5)
    assert client.ask(3, "01 00 30 00 01") == "01 01 00"


def test_a_drive_without_power_is_silent_on_a_serial_line(start, connect):
    bench = start(arms=None, sample_stage=None, **drives("rtu"))
    connection = connect(bench.addresses["source"])
    switch_on(bench, "power_cycle", device="stage", off_s=5.0)
    Client(connection, "rtu").ask(1, ALARM)
    connection.sendall(b"\x03" + bytes.fromhex(HOMED) + crc16(b"\x03" + bytes.fromhex(HOMED)))
    bench.clock.sleep(3)
    bench.clock.sleep(0)
    connection.setblocking(False)
    with pytest.raises(BlockingIOError):
        connection.recv(100)


def test_a_rotator_that_loses_its_power_leaves_the_slider_on_its_bus_alone(start, connect):
    bench = start(sample_stage=None, **modules("2", "5"))
    connection = connect(bench.addresses["stage"])
    switch_on(bench, "power_cycle", device="stage", off_s=5.0)
    connection.sendall(b"2gs5gs")
    assert connection.recv(100) == b"5GS00\r\n"
    bench.clock.sleep(5)
    connection.sendall(b"2gs")
    assert connection.recv(100) == b"2GS00\r\n"


def test_what_has_no_port_has_no_fault_there(start):
    bench = start(rotator={"type": "thorlabs_elliptec", "axis": "polarizer"}, analyzer={"type": "rotating_polarizer"})
    with pytest.raises(ConfigurationError, match="analyzer is a rotating_polarizer, which has no port where late"):
        switch_on(bench, "late", device="analyzer", late_s=1.0)


@pytest.mark.parametrize(
    ("devices", "reason"),
    [
        (
            {"arms": None, "sample_stage": None, **drives("rtu"), "stage": lec(2, line="rs485")},
            "detector and stage share the line rs485, and both are unit 2; give each its own",
        ),
        (
            {"sample_stage": None, **modules("A", "A")},
            "analyzer and stage share the line bus, and both are address A",
        ),
        (
            {"arms": None, "sample_stage": None, **drives("tcp"), "stage": lec(3, line="rs485")},
            "the devices on the line rs485 speak Modbus RTU and Modbus TCP",
        ),
        (
            {
                "sample_stage": None,
                **modules("2", "5"),
                "meter": {"type": "thorlabs_pm100", "acceptance_sr": 1e-3, "line": "bus"},
            },
            "meter shares the line bus, and a thorlabs_pm100 has no address there",
        ),
    ],
)
def test_devices_that_cannot_share_a_line_are_refused(start, devices, reason):
    with pytest.raises(ValidationError, match=reason):
        start(**devices)
