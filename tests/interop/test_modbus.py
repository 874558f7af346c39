"""MinimalModbus, pymodbus and mbpoll drive the Oriental Motor AZ and the SMC LEC."""

import shutil
import sys

import pytest

pytestmark = [
    pytest.mark.interop,
    pytest.mark.skipif(sys.platform == "win32", reason="the drives are on serial lines, and Windows has no ptys"),
]

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, NO_SUCH_UNIT = 1, 2, 3, 11


@pytest.fixture
def drives(serve):
    """Serial ports of an AZ and a LEC, and a gateway with one of each."""
    with serve("iron") as iron, serve("stages") as stages, serve("gateway") as gateway:
        assert gateway.addresses["az"] == gateway.addresses["lec"]
        yield iron.addresses["sample_stage"].pty, stages.addresses["table"].pty, gateway.addresses["az"].tcp


def test_minimalmodbus_drives_both(drives, session):
    az_port, lec_port, _ = drives
    found = session("minimalmodbus_session.py", az_port, lec_port)
    assert found["moved"]
    assert found["in position"]
    assert found["position"] == 1500
    assert found["odd address"]
    assert "function" in found["unsupported function"].lower()
    assert found["position after ZHOME"] == 0
    lec = found["lec"]
    assert "function" in lec["function 06"].lower()
    assert [lec["position"], lec["target"], lec["start"]] == [-4500, -4500, 0]
    assert lec["coils"] == [1, 0, 0, 0]
    # not busy; servo, homed and in position; no emergency, no alarm
    assert lec["inputs"] == [0, 1, 1, 1, 0, 0, 0, 0]


def test_pymodbus_drives_both_on_serial_lines_and_behind_a_gateway(drives, session):
    found = session("pymodbus_session.py", *drives)
    for az in (found["az by rtu"], found["az by tcp"]):
        assert az["echo"] == "1234"
        assert az["position"] == -2500
        assert az["written and read"] == 500
        assert az["position after it"] == -2000
        assert az["home"] == 0
        assert az["exceptions"] == [ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE]
    for lec in (found["lec by rtu"], found["lec by tcp"]):
        assert lec["position"] == -3000
        assert lec["in position"]
        assert [lec["function 06"], lec["beyond"]] == [ILLEGAL_FUNCTION, ILLEGAL_ADDRESS]
    assert found["nobody"] == NO_SUCH_UNIT


@pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll is not installed: apt-get install mbpoll")
def test_mbpoll_drives_both_on_serial_lines_and_behind_a_gateway(drives, session):
    found = session("mbpoll_session.py", *drives)
    for az in (found["az by rtu"], found["az by tcp"]):
        assert az["position"] == [-1500]
        assert az["stored position"] == [7]
        assert az["several items"] == [-1500, 2000]
        assert "Illegal data address" in az["odd address"]
        assert "Illegal function" in az["coils"]
        assert "Illegal function" in az["input registers"]
    for lec in (found["lec by rtu"], found["lec by tcp"]):
        assert lec["state"] == [0] * 16
        assert "Illegal function" in lec["single register"]
        assert lec["start"] == [0, 0]
        assert lec["position"] == [4500]
        assert lec["coils"] == [1, 0, 0, 0]
        assert lec["inputs"] == [0] * 9 + [1, 1, 1] + [0] * 4
        assert "Illegal data address" in lec["beyond the coils"]
    assert "failed to respond" in found["nobody"]
