"""Other people's clients and our drivers take turns on one bench."""

from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from goniometer.assembly import connected
from goniometer.bench import served_ports
from goniometer.load_files import load_rig

pytestmark = pytest.mark.interop

RIG = Path(__file__).resolve().parents[2] / "rigs" / "simulated.yaml"


def test_clients_and_our_drivers_take_turns_on_one_bench(serve, session):
    rig = load_rig(RIG)
    with serve("iron") as bench:
        for _ in range(2):
            session("pymeasure_session.py", bench.addresses["arms"].tcp, bench.addresses["meter"].tcp)
            with connected(rig, served_ports(rig, bench), bench.clock, 550.0) as devices:
                assert_allclose(devices.source_arm.position_deg(), 12.5, atol=1e-3)
                devices.source_arm.start_move(3.0)
                while devices.source_arm.is_moving():
                    bench.clock.sleep(0.02)
                assert_allclose(devices.source_arm.position_deg(), 3.0, atol=1e-3)
