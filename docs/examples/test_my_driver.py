"""A test of somebody's own instrument software: a plain pyserial client on the simulated bench."""

from pathlib import Path

import serial

SCENE = Path(__file__).parents[2] / "scenes" / "iron.yaml"  # your own scene file, beside your tests


def test_the_arm_arrives(goniometer_bench):
    bench = goniometer_bench(SCENE)
    port = serial.serial_for_url(bench.addresses["arms"].tcp, timeout=5)
    port.write(b"1MO\r1PA12.5\r")
    port.write(b"1MD?\r")
    assert port.readline() == b"0\r\n"
    bench.clock.sleep(2.0)
    port.write(b"1TP?\r")
    assert float(port.readline()) == 12.5
    assert bench.world.axes["source_arm"].position_deg(bench.clock.now()) == 12.5
