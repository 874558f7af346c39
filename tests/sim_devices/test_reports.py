"""What happens to a device on a bench is told to all of its clients, asked or not, and to those of no other device."""

import pytest

from sim_devices.bench import Bench
from sim_devices.faults.known import one_fault
from sim_devices.serving.clock import VirtualClock

MOVE = bytes.fromhex("53 04 06 00 A1 01 01 00 00 C0 5D 00")
STOPPED, BUTTON, MOVED = bytes.fromhex("66 04 0E 00 81 21"), b"3BS00\r\n", b"3BO00000020\r\n"


@pytest.fixture
def bench(scene_with, scene_document):
    devices = scene_document["devices"] | {
        "arms": {"type": "thorlabs_apt", "stage": "HDR50", "axes": {1: "source_arm", 2: "detector_arm"}},
        "analyzer": {
            "type": "thorlabs_elliptec_slider",
            "address": "3",
            "line": "bus",
            "slots": {1: "open", 2: 0, 3: 45, 4: 90},
        },
        "turner": {"type": "thorlabs_elliptec", "address": "2", "line": "bus", "axis": "polarizer"},
    }
    with Bench(scene_with(devices=devices), VirtualClock()) as bench:
        yield bench


def strike(bench, **fault):
    bench.faults.switch_on(one_fault.validate_python(fault))


def heard(connection, size):
    received = b""
    while len(received) < size:
        received += connection.recv(size - len(received))
    return received


def is_silent(connection):
    connection.setblocking(False)
    try:
        return not connection.recv(1)
    except BlockingIOError:
        return True
    finally:
        connection.settimeout(5)


def test_a_limit_switch_is_heard_by_those_who_only_listen(bench, connect):
    listener, mover, other = (connect(bench.addresses[name]) for name in ("arms", "arms", "meter"))
    strike(bench, fault="limit_hit", axis="source_arm", into_motion_s=0.3)
    mover.sendall(MOVE)
    bench.clock.sleep(1.0)
    assert heard(listener, 20)[:6] == heard(mover, 20)[:6] == STOPPED
    bench.clock.sleep(60.0)
    assert all(map(is_silent, (listener, mover, other)))


def test_a_button_is_heard_on_the_whole_line_at_once_and_at_the_end_of_the_motion(bench, connect):
    assert bench.addresses["analyzer"] == bench.addresses["turner"]
    clients = [connect(bench.addresses["turner"]) for _ in range(2)]
    for client in clients:
        client.sendall(b"2gs")
        assert heard(client, 7) == b"2GS00\r\n"
    strike(bench, fault="wheel_by_hand", device="analyzer", at_s=10.0)
    bench.clock.sleep(10.0)
    assert [heard(client, len(BUTTON)) for client in clients] == [BUTTON] * 2
    assert all(map(is_silent, clients))
    bench.clock.sleep(1.0)
    assert [heard(client, len(MOVED)) for client in clients] == [MOVED] * 2
