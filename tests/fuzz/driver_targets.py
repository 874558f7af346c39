"""Every driver, with the simulated device that it talks to."""

from __future__ import annotations

from collections.abc import Callable

from device_targets import Lamp
from driver_run import Begin, Conversation, DriverRun
from garbling_port import FuzzClock
from target import Target

from drivers.modbus.frames import RtuFraming, TcpFraming
from drivers.modbus.unit import ModbusUnit
from drivers.newport_esp301.stage import NewportEsp301 as Esp301Driver
from drivers.oriental_az.stage import OrientalAz as AzDriver
from drivers.smc_lec.controller import SmcLecController
from drivers.smc_lec.registers import LecRegisters
from drivers.stanford_sr830.lock_in import Sr830LockIn
from drivers.thorlabs_apt.port import AptPort
from drivers.thorlabs_apt.stage import ThorlabsApt as AptDriver
from drivers.thorlabs_elliptec.bus import ElliptecBus
from drivers.thorlabs_elliptec.rotator import ElliptecRotator as EllDriver
from drivers.thorlabs_fw102c import ThorlabsFw102c as WheelDriver
from drivers.thorlabs_pm100.meter import ThorlabsPm100 as MeterDriver
from drivers.wire.link import Link
from sim_devices.axis import Axis
from sim_devices.device import Device
from sim_devices.modbus.tcp import ModbusTcp
from sim_devices.newport_esp301.controller import NewportEsp301
from sim_devices.oriental_az.drive import OrientalAz
from sim_devices.smc_lec.controller import SmcLec
from sim_devices.stanford_sr830.instrument import StanfordSr830
from sim_devices.thorlabs_apt.controller import ThorlabsApt
from sim_devices.thorlabs_apt.models import K10CR1
from sim_devices.thorlabs_elliptec.bus import ThorlabsElliptec
from sim_devices.thorlabs_elliptec.rotator import STEP_DEG, ElliptecRotator
from sim_devices.thorlabs_fw102c import ThorlabsFw102c
from sim_devices.thorlabs_pm100.meter import ThorlabsPm100
from sim_devices.wheel import Wheel

_SPEED = {"velocity_deg_s": 10.0, "acceleration_deg_s2": 20.0}


def _target(name: str, build: Callable[[], tuple[Device, Begin]], address: str = "socket://fuzz:1") -> Target:
    return Target(name, "driver", lambda random_: DriverRun(*build(), address, random_))


def _esp301() -> tuple[Device, Begin]:
    axis = Axis(0.0005)

    def begin(link: Link, clock: FuzzClock) -> Conversation:
        controller = Esp301Driver(link, clock)
        stage = controller.stage(1, name="arm", **_SPEED)
        requests = (
            controller.connect,
            stage.connect,
            stage.position_deg,
            stage.is_moving,
            lambda: stage.start_move(12.5),
            stage.start_homing,
            stage.stop,
        )

        def ask() -> float:
            controller.connect()
            return stage.position_deg()

        return Conversation(requests, ask, lambda: axis.position_deg(clock.now_s), 1e-3)

    return NewportEsp301({1: axis}), begin


def _fw102c() -> tuple[Device, Begin]:
    wheel = Wheel()

    def begin(link: Link, clock: FuzzClock) -> Conversation:
        driver = WheelDriver(link, clock, name="wheel", slot_s=1.0, settle_s=0.0)
        requests = (driver.connect, driver.slot, lambda: driver.start_select(3), driver.is_moving, driver.stop)
        return Conversation(requests, driver.slot, lambda: wheel.target, 0)

    return ThorlabsFw102c(wheel, range(1, 7)), begin


def _pm100() -> tuple[Device, Begin]:
    def begin(link: Link, clock: FuzzClock) -> Conversation:
        driver = MeterDriver(link, clock, name="meter", sample_s=0.003)

        def read() -> float:
            driver.connect()
            driver.start_reading(0.03)
            while driver.is_reading():
                clock.sleep(0.01)
            return driver.power_w()

        requests = (
            driver.connect,
            lambda: driver.set_wavelength_nm(550),
            lambda: driver.start_reading(0.03),
            driver.is_reading,
            driver.power_w,
        )
        return Conversation(requests, read, lambda: 1e-6, 1e-12)

    return ThorlabsPm100(Lamp()), begin


def _sr830() -> tuple[Device, Begin]:
    def begin(link: Link, clock: FuzzClock) -> Conversation:
        driver = Sr830LockIn(link, name="lock-in")
        requests = (
            driver.begin,
            driver.settings,
            driver.sensitivity,
            driver.condition,
            driver.sample,
            lambda: driver.set_sensitivity(17),
        )

        def ask() -> float:
            driver.begin()
            return driver.sample().reference_hz

        return Conversation(requests, ask, lambda: 1000.0, 1e-9)

    return StanfordSr830(Lamp()), begin


class _Port:
    """What a Modbus unit needs of its port."""

    address = "fuzz"

    def __init__(self, link: Link, *, over_tcp: bool) -> None:
        self.framing = TcpFraming() if over_tcp else RtuFraming()
        self._link = link

    def link(self) -> Link:
        """The link."""
        return self._link

    def rest(self) -> None:
        """Need no silence."""

    def wait_until_rested(self) -> None:
        """Need no silence."""

    def close(self) -> None:
        """Close the link."""


def _az(*, over_tcp: bool) -> Callable[[], tuple[Device, Begin]]:
    def build() -> tuple[Device, Begin]:
        axis = Axis(0.02)
        drive = OrientalAz(1, axis)

        def begin(link: Link, clock: FuzzClock) -> Conversation:
            unit = ModbusUnit(_Port(link, over_tcp=over_tcp), 1, device="stage")  # type: ignore[arg-type]
            driver = AzDriver(unit, clock, name="stage", steps_per_deg=50.0, **_SPEED)
            requests = (
                driver.connect,
                driver.position_deg,
                driver.is_moving,
                lambda: driver.start_move(33.0),
                driver.start_homing,
                driver.stop,
            )
            return Conversation(requests, driver.position_deg, lambda: axis.position_deg(clock.now_s), 0.02)

        return ModbusTcp([drive]) if over_tcp else drive, begin

    return build


def _lec(*, over_tcp: bool) -> Callable[[], tuple[Device, Begin]]:
    def build() -> tuple[Device, Begin]:
        axis = Axis(0.01)
        lec = SmcLec(1, axis)

        def begin(link: Link, clock: FuzzClock) -> Conversation:
            unit = ModbusUnit(_Port(link, over_tcp=over_tcp), 1, device="table")  # type: ignore[arg-type]
            driver = SmcLecController(unit, clock, name="table", registers=LecRegisters())
            requests = (driver.take_control, driver.status, driver.motion, driver.begin_homing, driver.end_homing)
            return Conversation(
                requests, lambda: driver.motion().position / 100, lambda: axis.position_deg(clock.now_s), 0.01
            )

        return ModbusTcp([lec]) if over_tcp else lec, begin

    return build


def _apt() -> tuple[Device, Begin]:
    axis = Axis(K10CR1.step_deg)

    def begin(link: Link, clock: FuzzClock) -> Conversation:
        driver = AptDriver(AptPort(link, clock), "K10CR1", name="rotator", **_SPEED)
        requests = (
            driver.connect,
            driver.position_deg,
            driver.is_moving,
            driver.is_homed,
            lambda: driver.start_move(10.0),
            driver.stop,
        )
        return Conversation(requests, driver.position_deg, lambda: axis.position_deg(clock.now_s), 1e-3)

    return ThorlabsApt(K10CR1, {1: axis}), begin


def _elliptec() -> tuple[Device, Begin]:
    axis = Axis(STEP_DEG)
    mover = ElliptecRotator(axis)

    def begin(link: Link, clock: FuzzClock) -> Conversation:
        driver = EllDriver(ElliptecBus(link, clock), 0, name="rotator", velocity_deg_s=400, acceleration_deg_s2=1000)
        requests = (
            driver.connect,
            driver.position_deg,
            driver.is_moving,
            lambda: driver.start_move(45.0),
            driver.start_homing,
            driver.is_homed,
            driver.stop,
        )

        def ask() -> float:
            driver.connect()
            return driver.position_deg()

        return Conversation(requests, ask, lambda: mover.position(clock.now_s) * STEP_DEG, 1e-6)

    return ThorlabsElliptec(mover), begin


TARGETS = [
    _target("esp301", _esp301),
    _target("fw102c", _fw102c),
    _target("pm100", _pm100),
    _target("sr830", _sr830),
    _target("az_rtu", _az(over_tcp=False)),
    _target("az_tcp", _az(over_tcp=True)),
    _target("lec_rtu", _lec(over_tcp=False)),
    _target("lec_tcp", _lec(over_tcp=True)),
    _target("apt", _apt),
    _target("elliptec", _elliptec),
]
