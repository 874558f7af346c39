"""A reading or a position by every driver, and the same bytes for a bare pyserial client to send."""

import select
from collections.abc import Callable
from dataclasses import dataclass

from drivers.modbus.port import ModbusPort
from drivers.modbus.unit import ModbusUnit
from drivers.newport_esp301.stage import NewportEsp301
from drivers.oriental_az.stage import OrientalAz
from drivers.smc_lec.stage import SmcLec
from drivers.stanford_sr830.lock_in import Sr830LockIn
from drivers.thorlabs_apt.port import AptPort
from drivers.thorlabs_apt.stage import ThorlabsApt
from drivers.thorlabs_elliptec.bus import ElliptecBus
from drivers.thorlabs_elliptec.rotator import ElliptecRotator
from drivers.thorlabs_fw102c import ThorlabsFw102c
from drivers.thorlabs_pm100.meter import ThorlabsPm100
from drivers.wire.link import Link

# 3.5 characters of 11 bits at 19200 baud, which end a Modbus frame on a serial line of any greater speed too
SILENCE_S = 3.5 * 11 / 19200
SPEEDS = {"velocity_deg_s": 10.0, "acceleration_deg_s2": 10.0}


@dataclass(frozen=True)
class Request:
    """A driver's call; `terminator` ends each reply, and is empty where its length does.

    `silence_s` must pass before the next request.
    """

    title: str
    call: Callable[[], object]
    port: str
    terminator: bytes = b""
    silence_s: float = 0.0


class Recorder:
    """A wire log that keeps, while `is_on`, what was sent and how many bytes came back."""

    def __init__(self):
        self.is_on, self._exchanges = False, []

    def sent(self, device, data):
        if self.is_on:
            self._exchanges.append((data, 0))

    def received(self, device, data):
        if self.is_on:
            question, length = self._exchanges[-1]
            self._exchanges[-1] = question, length + len(data)

    def event(self, device, event):
        if self.is_on:
            raise RuntimeError(f"{device}: {event}")

    def exchanges(self, call):
        """Questions of a call, and the lengths of their replies."""
        self._exchanges, self.is_on = [], True
        call()
        self.is_on = False
        return self._exchanges


class FreeClock:
    """Time that passes when somebody waits, and costs nothing."""

    def __init__(self):
        self._now_s = 0.0

    def now(self):
        return self._now_s

    def sleep(self, duration_s):
        self._now_s += duration_s


def requests(addresses, wire_log):
    """Connect a driver of every family to the servers' ports, `addresses` of TCP and of a pty by device."""
    clock = FreeClock()

    def pty(device):
        return addresses[device][1]

    def link(device):
        return Link(pty(device), device=device, wire_log=wire_log)

    def tcp(device):
        return addresses[device][0]

    def az(address):
        unit = ModbusUnit(ModbusPort(address, device="az", wire_log=wire_log), 1, device="az")
        return OrientalAz(unit, clock, name="az", steps_per_deg=50, **SPEEDS)

    def lec(address):
        unit = ModbusUnit(ModbusPort(address, device="lec", wire_log=wire_log), 1, device="lec")
        return SmcLec(unit, clock, name="lec", velocity_deg_s=10, acceleration_deg_s2=10)

    arm = NewportEsp301(link("arms"), clock).stage(1, name="arm", **SPEEDS)
    wheel = ThorlabsFw102c(link("analyzer"), clock, name="wheel", slot_s=0.5, settle_s=0.0)
    meter_link = link("meter")
    meter = ThorlabsPm100(meter_link, clock, name="meter", sample_s=0.003)
    lock_in = Sr830LockIn(link("lock_in"), name="lock-in")
    unit = ThorlabsApt(AptPort(link("unit"), clock), "K10CR1", name="unit", **SPEEDS)
    rotator = ElliptecRotator(
        ElliptecBus(link("rotator"), clock), 2, name="rotator", velocity_deg_s=400.0, acceleration_deg_s2=1000.0
    )
    drives = az(tcp("sample_stage")), az(pty("sample_stage")), lec(tcp("table")), lec(pty("table"))
    lock_in.begin()
    for driver in (arm, wheel, meter, unit, rotator, *drives):
        driver.connect()

    def power():
        meter.start_reading(0.003)
        while meter.is_reading():
            # the engine waits on the bench's clock here
            select.select([meter_link], [], [], 1.0)
        return meter.power_w()

    az_tcp, az_pty, lec_tcp, lec_pty = (drive.position_deg for drive in drives)
    return [
        Request("ESP301 position", arm.position_deg, pty("arms"), b"\r\n"),
        Request("FW102C slot", wheel.slot, pty("analyzer"), b"> "),
        Request("PM100 reading", power, pty("meter"), b"\n"),
        Request("SR830 sample", lock_in.sample, pty("lock_in"), b"\r"),
        Request("APT status", unit.position_deg, pty("unit")),
        Request("Elliptec position", rotator.position_deg, pty("rotator"), b"\r\n"),
        Request("AZ position, with its silence", az_pty, pty("sample_stage"), silence_s=SILENCE_S),
        Request("AZ position, RTU over TCP", az_tcp, tcp("sample_stage")),
        Request("LEC position, with its silence", lec_pty, pty("table"), silence_s=SILENCE_S),
        Request("LEC position, RTU over TCP", lec_tcp, tcp("table")),
    ]
