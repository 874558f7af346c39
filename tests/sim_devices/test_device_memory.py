"""A client that sends for ever fills no memory of a device; what is said to it is the reactor's to bound."""

import gc
import struct
import tracemalloc

import pytest

from sim_devices.modbus.rtu import crc16
from sim_devices.world import World


def apt(number, data):
    return struct.pack("<HHBB", number, len(data), 0xA1, 1) + data


def framed(text):
    return bytes.fromhex(text) + crc16(bytes.fromhex(text))


LOCK_IN = {"type": "stanford_sr830", "acceptance_sr": 1e-3, "volts_per_watt": 1e5}
RACK = {"type": "thorlabs_apt", "stage": "HDR50", "axes": {1: "source_arm", 2: "detector_arm"}}
ROTATOR = {"type": "thorlabs_elliptec", "axis": "sample_azimuth"}
TABLE = {"type": "smc_lec", "unit": 1, "axis": "sample_azimuth"}
STREAMS = [
    ("arms", {}, b"1MO;1PA5;TB?\r"),
    ("arms", {}, b"WT3600000\r1TP\r"),
    ("arms", RACK, apt(0x0453, struct.pack("<Hi", 1, 2**29)) + apt(0x0453, struct.pack("<Hi", 1, -(2**29)))),
    ("arms", RACK, struct.pack("<HBBBB", 0x0011, 0, 0, 0x11, 1)),
    ("arms", RACK, struct.pack("<HBBBB", 0x0443, 1, 0, 0x21, 1) + struct.pack("<HBBBB", 0x0465, 1, 2, 0x21, 1)),
    ("sample_stage", {}, framed("01 06 00 7D 00 10")),
    ("sample_stage", TABLE, framed("01 05 00 19 FF 00")),
    ("sample_stage", ROTATOR, b"0ma00004600"),
    ("sample_stage", ROTATOR, b"0s10st0m"),
    ("analyzer", {}, b"pos=2\rpos=1\r"),
    ("analyzer", {}, b"\x1b[A\r"),
    ("meter", {}, b"*IDN?\n"),
    ("meter", {}, b"SENS:AVER 3000;:READ?\n"),
    ("meter", LOCK_IN, b"AGAN;APHS;AOFF1\r"),
    ("meter", LOCK_IN, b"SNAP?1,2,3,4,5,6\r"),
]
MESSAGES, LEAST_BYTES = 150, 24
"""Whatever is kept of a message takes more than that."""


@pytest.fixture
def session(scene_with, scene_document):
    """A client of one of the scene's devices, or of another in its place."""

    def begin(name, entry):
        devices = scene_document["devices"] | ({name: entry} if entry else {})
        return World(scene_with(devices=devices)).devices[name].session()

    return begin


@pytest.mark.parametrize(("name", "entry", "stream"), STREAMS)
def test_a_device_keeps_nothing_of_what_it_has_been_told_while_time_stands_still(session, name, entry, stream):
    client, held_bytes = session(name, entry), []
    tracemalloc.start()
    try:
        for _ in range(3):
            for _ in range(MESSAGES):
                client.receive(stream, 1.0)
            gc.collect()
            held_bytes.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert held_bytes[2] - held_bytes[1] < LEAST_BYTES * MESSAGES
