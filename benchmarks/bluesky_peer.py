"""Bluesky's RunEngine on in-memory devices: the scan of iron_60deg, counted as CPU time a reading. Prints JSON."""

import json
import time

import bluesky
import bluesky.plan_stubs as bps
import bluesky.preprocessors as bpp
from bluesky import RunEngine

EXITS, SLOTS, REPEATS = 61, 5, 3


class Done:
    """A status that is done from the beginning."""

    done = success = True

    def add_callback(self, callback):
        callback(self)

    def exception(self, timeout=0.0):
        return None


class Axis:
    """A motor that is where it was sent."""

    parent = None

    def __init__(self, name):
        self.name, self.value = name, 0.0

    def set(self, value):
        self.value = value
        return Done()

    def trigger(self):
        return Done()

    def read(self):
        return {self.name: {"value": self.value, "timestamp": 0.0}}

    def describe(self):
        return {self.name: {"source": "memory", "dtype": "number", "shape": []}}

    def read_configuration(self):
        return {}

    def describe_configuration(self):
        return {}


source, detector, azimuth, wheel, meter = map(Axis, ("source", "detector", "azimuth", "wheel", "meter"))


@bpp.run_decorator()
def scan():
    for exit_deg in range(EXITS):
        for slot in range(SLOTS):
            yield from bps.mv(source, 60.0, detector, exit_deg, azimuth, 0.0, wheel, slot)
            for _ in range(REPEATS):
                yield from bps.trigger_and_read([meter, source, detector, azimuth, wheel])


if __name__ == "__main__":
    engine = RunEngine(context_managers=[])
    engine(scan())
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    engine(scan())
    cpu_s, wall_s = time.process_time() - cpu_s, time.perf_counter() - wall_s
    readings = EXITS * SLOTS * REPEATS
    print(
        json.dumps(
            {"version": bluesky.__version__, "cpu_ms": 1e3 * cpu_s / readings, "wall_ms": 1e3 * wall_s / readings}
        )
    )
