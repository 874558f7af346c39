"""A simulated bench as a pytest fixture, for whoever tests instrument software: no hardware, no waiting."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from goniometer.bench import Speed
    from sim_devices.bench import Bench

MakeBench = Callable[..., "Bench"]


@pytest.fixture
def goniometer_bench() -> Iterator[MakeBench]:
    """Start simulated benches that are stopped when the test ends.

    The fixture is a function of a scene file and a speed, ``goniometer_bench("scenes/iron.yaml", speed=10)``, which
    returns a running bench. Its ``addresses`` say where each device of the scene listens: ``addresses["arms"].tcp``
    for ``serial.serial_for_url``, and ``addresses["arms"].pty`` for clients that open serial ports only. Its ``clock``
    tells the bench's time, and its ``world`` the truth behind the readings.

    At the speed "max", the default, time is virtual: it passes when somebody sleeps on ``clock``. Clients that wait
    with ``time.sleep`` need a number, seconds of the bench in one real second.
    """
    from goniometer.bench import simulate

    with ExitStack() as benches:

        def start(scene: str | Path, speed: Speed = "max") -> Bench:
            return benches.enter_context(simulate(scene, speed))

        yield start
