"""Every simulated device, as a host sees it."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Callable, Sequence

from crc16 import framed
from device_frames import (
    APT_FRAMES,
    AZ_BODIES,
    ELLIPTEC_FRAMES,
    ESP301_FRAMES,
    FW102C_FRAMES,
    LEC_BODIES,
    PM100_FRAMES,
    SR830_FRAMES,
)
from device_run import Bench, DeviceRun, Wire
from target import Target

from sim_devices.axis import Axis
from sim_devices.modbus.tcp import ModbusTcp
from sim_devices.newport_esp301.controller import NewportEsp301
from sim_devices.oriental_az.drive import OrientalAz
from sim_devices.serving.shared_line import SharedLine
from sim_devices.smc_lec.controller import SmcLec
from sim_devices.stanford_sr830.instrument import StanfordSr830
from sim_devices.thorlabs_apt.controller import ThorlabsApt
from sim_devices.thorlabs_apt.models import BSC200_HDR50, K10CR1, KDC101_PRM1Z8, AptModel
from sim_devices.thorlabs_elliptec.bus import ThorlabsElliptec
from sim_devices.thorlabs_elliptec.rotator import STEP_DEG, ElliptecRotator
from sim_devices.thorlabs_elliptec.slider import ElliptecSlider
from sim_devices.thorlabs_fw102c import ThorlabsFw102c
from sim_devices.thorlabs_pm100.meter import ThorlabsPm100
from sim_devices.wheel import Wheel


class Lamp:
    """A light that does not change."""

    def power_w(self, time_s: float) -> float:
        """Power at a time."""
        return 1e-6

    def measure_w(self, time_s: float, exposure_s: float) -> float:
        """Mean power over an exposure."""
        return 1e-6

    def open_w(self, time_s: float, exposure_s: float) -> float:
        """What a detector tells while a chopper is open."""
        return 1e-6

    def closed_w(self, time_s: float, exposure_s: float) -> float:
        """What it tells while the chopper is closed."""
        return 0.0

    def noise_w(self, time_s: float, exposure_s: float) -> float:
        """No noise."""
        return 0.0


def _never(data: bytes) -> bool:
    return False


def _pattern(pattern: bytes, dropped: bytes = b"") -> Callable[[bytes], bool]:
    """Whether bytes, some of them dropped, hold a pattern."""
    compiled = re.compile(pattern, re.DOTALL)
    return lambda data: compiled.search(data.translate(None, dropped)) is not None


def _esp301() -> Bench:
    axes = {1: Axis(0.0005), 2: Axis(0.0005)}
    return Bench(NewportEsp301(axes), lambda: tuple(axis.target_deg for axis in axes.values()), [])


def _fw102c() -> Bench:
    wheel = Wheel()
    return Bench(ThorlabsFw102c(wheel, range(1, 7)), lambda: wheel.target, [])


def _pm100() -> Bench:
    meter = ThorlabsPm100(Lamp())
    ask = meter.session()
    return Bench(meter, lambda: ask.receive(b"SENS:CORR:WAV?\n", 0.0)[0][1], [])


def _sr830() -> Bench:
    lock_in = StanfordSr830(Lamp())
    return Bench(lock_in, lambda: lock_in._settings["OFLT"], [])


def _modbus(kind: Callable[[int, Axis], OrientalAz | SmcLec], *, over_tcp: bool) -> Callable[[], Bench]:
    def build() -> Bench:
        axis, accepted = Axis(0.01), []
        unit = kind(1, axis)
        obey = unit.answer

        def answer(request: bytes, now_s: float) -> bytes:
            accepted.append(request)
            return obey(request, now_s)

        unit.answer = answer  # type: ignore[method-assign]
        return Bench(ModbusTcp([unit]) if over_tcp else unit, lambda: axis.target_deg, accepted)

    return build


def _apt(model: AptModel, numbers: Sequence[int]) -> Callable[[], Bench]:
    def build() -> Bench:
        axes = {number: Axis(model.step_deg) for number in numbers}
        return Bench(ThorlabsApt(model, axes), lambda: tuple(axis.target_deg for axis in axes.values()), [])

    return build


def _elliptec() -> Bench:
    axis = Axis(STEP_DEG)
    return Bench(ThorlabsElliptec(ElliptecRotator(axis)), lambda: axis.target_deg, [])


def _shared_line() -> Bench:
    axes, wheel = (Axis(STEP_DEG), Axis(STEP_DEG)), Wheel()
    modules = [ThorlabsElliptec(ElliptecRotator(axis), address) for axis, address in zip(axes, "02", strict=True)]
    modules.append(ThorlabsElliptec(ElliptecSlider(wheel), "5"))
    return Bench(SharedLine(modules), lambda: (*(axis.target_deg for axis in axes), wheel.target), [])


_ESP301_MOVES = re.compile(r"\d*(PA|PR|MV|MT|OR|ST|AB|RS|MF)")
_APT_MOVES = _pattern(rb"[\x43\x48\x53\x57\x65\x6A]\x04|\x10\x02")
_ALL_ADDRESSES = b"".join(b"%Xgs" % address for address in range(16))


def _esp301_may_change(data: bytes) -> bool:
    text = "".join(
        character for character in data.decode("latin-1").upper() if not character.isspace() or character == "\r"
    )
    return any(_ESP301_MOVES.match(command) for command in re.split("[\r;]", text))


def _rtu(bodies: Sequence[bytes], build: Callable[[], Bench]) -> Wire:
    probe = framed(bytes.fromhex("01 08 00 00 12 34"))
    return Wire(
        build, [framed(body) for body in bodies], b"", 0.0, probe, re.escape(probe), _never, (0.0,), has_checksums=True
    )


def _tcp(bodies: Sequence[bytes], build: Callable[[], Bench]) -> Wire:
    messages = [struct.pack(">HHH", 7, 0, len(body)) + body for body in bodies]
    probe = bytes.fromhex("12 34 00 00 00 06 01 08 00 00 12 34")
    writes = rb"..\0\0\0[\x02-\xFE][\0\1][\x05\x06\x0F\x10\x17]"
    return Wire(build, messages, None, 0.0, probe, re.escape(probe), _pattern(writes))


def _apt_wire(model: AptModel, numbers: Sequence[int], address: int) -> Wire:
    ask = 0x90 if model.is_servo else 0x80
    probe = bytes((ask, 0x04, 1, 0, address, 1))
    answer = re.escape(bytes((ask + 1, 0x04, 14, 0, 0x81, address, 1, 0)))
    return Wire(_apt(model, numbers), APT_FRAMES, b"", 0.6, probe, answer, _APT_MOVES)


WIRES = {
    "esp301": Wire(_esp301, ESP301_FRAMES, b"\r", 0.0, b"VE?\r", rb"ESP301", _esp301_may_change),
    "fw102c": Wire(
        _fw102c, FW102C_FRAMES, b"\r", 0.0, b"pcount?\r", rb"pcount\?\r(6|12)\r> $", _pattern(rb"pos=|\x1B", b"\0\n")
    ),
    "pm100": Wire(
        _pm100, PM100_FRAMES, b"\n", 0.0, b"*IDN?\n", rb"^THORLABS,PM100D[^;]*\n$", _pattern(rb"(?i)WAV|\*RST")
    ),
    "sr830": Wire(
        _sr830,
        SR830_FRAMES,
        b"\rOUTX 0\r",
        0.0,
        b"*IDN?\r",
        rb"^Stanford_Research_Systems,SR830[^\r]*\r$",
        _pattern(rb"(?i)OFLT|\*RST", bytes(range(33)) + b"\x85\xa0"),
    ),
    "az_rtu": _rtu(AZ_BODIES, _modbus(OrientalAz, over_tcp=False)),
    "az_tcp": _tcp(AZ_BODIES, _modbus(OrientalAz, over_tcp=True)),
    "lec_rtu": _rtu(LEC_BODIES, _modbus(SmcLec, over_tcp=False)),
    "lec_tcp": _tcp(LEC_BODIES, _modbus(SmcLec, over_tcp=True)),
    "apt_k10cr1": _apt_wire(K10CR1, [1], 0x50),
    "apt_kdc101": _apt_wire(KDC101_PRM1Z8, [1], 0x50),
    "apt_bsc202": _apt_wire(BSC200_HDR50, [1, 2], 0x22),
    "elliptec": Wire(
        _elliptec,
        ELLIPTEC_FRAMES,
        b"\r",
        0.0,
        _ALL_ADDRESSES,
        rb"^([0-9A-F]GS..\r\n)+$",
        _pattern(rb"ho|ma|mr|fw|bw|st", b"\n"),
        (15400.0,),
    ),
    "elliptec_line": Wire(
        _shared_line,
        ELLIPTEC_FRAMES,
        b"\r",
        0.0,
        _ALL_ADDRESSES,
        rb"([0-9A-F]GS..\r\n){3}",
        _pattern(rb"ho|ma|mr|fw|bw|st", b"\n"),
        (15400.0,),
    ),
}


def begin(name: str) -> Callable[[random.Random], DeviceRun]:
    """How a device's run begins."""
    return lambda random_: DeviceRun(WIRES[name], random_)


TARGETS = [Target(name, "device", begin(name)) for name in WIRES]
