"""A simulated Thorlabs PM100D power meter with an S120C photodiode head."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from sim_devices.device import Due, Later
from sim_devices.effects import SAMPLE_S
from sim_devices.light import Light
from sim_devices.serving.lines import LineSplitter
from sim_devices.thorlabs_pm100 import scpi
from sim_devices.thorlabs_pm100.photodiode_head import OVER_RANGE, RANGES_W, PhotodiodeHead
from sim_devices.thorlabs_pm100.scpi_numbers import number, parse, parse_switch, tell

_LATENCY_S = 0.002
_SOON_S = 0.02
_IDENTITY = "THORLABS,PM100D,P0012345,2.8.0"
_SENSOR = "S120C,12061234,07-May-2024,1,18,33"
_NOT_A_NUMBER = 9.91e37
_LONGEST_LINE = 256

# queries for a number with limits take MIN or MAX
_QUERIES_WITH_LIMITS = frozenset(
    spelling
    for pattern in (
        "SENSe:CORRection:WAVelength?",
        "SENSe:CORRection[:LOSS]?",
        "SENSe:POWer[:DC]:RANGe[:UPPer]?",
        "SENSe:AVERage[:COUNt]?",
    )
    for spelling in scpi.headers(pattern)
)

_POWER_ON, _COMMAND_ERROR, _EXECUTION_ERROR = 0x80, 0x20, 0x10
_ERROR_AVAILABLE = 0x04


class _Reading(NamedTuple):
    power_w: float
    ready_s: float


class ThorlabsPm100:
    """A power meter that looks at a light.

    A reading takes 3 ms times the averaging count. Commands are run one after the other; a query for a reading that is
    not finished is answered, and lets the commands behind it run, when it is.
    """

    def __init__(self, light: Light) -> None:
        self._head = PhotodiodeHead(light)
        self._errors = scpi.ErrorQueue()
        self._events = _POWER_ON
        self._free_s = 0.0
        self._set_defaults()
        self._commands: dict[str, Callable[[list[str], float], str | None]] = {
            spelling: command for pattern, command in self._table().items() for spelling in scpi.headers(pattern)
        }

    def _set_defaults(self) -> None:
        self._unit = "W"
        self._average = 1
        self._wavelength_nm = 635.0
        self._head.range_w = None
        self._loss_db = 0.0
        self._filter = 0
        self._reading: _Reading | None = None

    def _table(self) -> dict[str, Callable[[list[str], float], str | None]]:
        return {
            "*IDN?": lambda arguments, now_s: _IDENTITY,
            "*RST": lambda arguments, now_s: self._set_defaults(),
            "*CLS": self._clear_status,
            "*OPC?": self._operation_complete,
            "*ESR?": self._event_status,
            "*STB?": lambda arguments, now_s: str(_ERROR_AVAILABLE if len(self._errors) else 0),
            "SYSTem:ERRor[:NEXT]?": lambda arguments, now_s: self._errors.next(),
            "SYSTem:SENSor:IDN?": lambda arguments, now_s: _SENSOR,
            "MEASure[:SCALar][:POWer]?": self._read,
            "MEASure[:SCALar]:TEMPerature?": self._read_temperature,
            "READ?": self._read,
            "FETCh?": self._fetch,
            "INITiate[:IMMediate]": self._initiate,
            "CONFigure[:SCALar][:POWer]": lambda arguments, now_s: None,
            "CONFigure?": lambda arguments, now_s: "POW",
            "SENSe:POWer[:DC]:UNIT": self._set_unit,
            "SENSe:POWer[:DC]:UNIT?": lambda arguments, now_s: self._unit,
            "SENSe:POWer[:DC]:RANGe[:UPPer]": self._set_range,
            "SENSe:POWer[:DC]:RANGe[:UPPer]?": self._tell_range,
            "SENSe:POWer[:DC]:RANGe:AUTO": self._set_auto_range,
            "SENSe:POWer[:DC]:RANGe:AUTO?": lambda arguments, now_s: str(int(self._head.range_w is None)),
            "SENSe:CORRection:WAVelength": self._set_wavelength,
            "SENSe:CORRection:WAVelength?": lambda arguments, now_s: tell(arguments, self._wavelength_nm, 400, 1100),
            "SENSe:CORRection[:LOSS]": self._set_loss,
            "SENSe:CORRection[:LOSS]?": lambda arguments, now_s: tell(arguments, self._loss_db, -60, 60),
            "SENSe:CORRection:COLLect:ZERO[:INITiate]": lambda arguments, now_s: self._head.collect_zero(now_s),
            "SENSe:CORRection:COLLect:ZERO:ABORt": lambda arguments, now_s: self._head.abort_zero(now_s),
            "SENSe:CORRection:COLLect:ZERO:STATe?": lambda arguments, now_s: str(int(self._head.collects_zero(now_s))),
            "SENSe:CORRection:COLLect:ZERO:MAGNitude?": lambda arguments, now_s: number(self._head.zero_w(now_s)),
            "SENSe:AVERage[:COUNt]": self._set_average,
            "SENSe:AVERage[:COUNt]?": self._tell_average,
            "INPut:FILTer": self._set_filter,
            "INPut:FILTer?": lambda arguments, now_s: str(self._filter),
        }

    def session(self) -> _Session:
        """A new client."""
        return _Session(self)

    def power_cycle(self, now_s: float) -> None:
        """Lose every setting, error and reading."""
        self._set_defaults()
        self._errors.clear()
        self._events, self._free_s = _POWER_ON, now_s

    def execute(self, line: str, arrival_s: float) -> list[Due]:
        """Run the commands of one line as soon as the meter is free; their answers share one line."""
        if len(line) > _LONGEST_LINE:
            self._refuse(scpi.ScpiError(-363))
            return []
        answers, asked_s = [], max(arrival_s, self._free_s)
        for header, arguments in scpi.commands(line):
            now_s = max(arrival_s, self._free_s)
            self._free_s = now_s + _LATENCY_S
            try:
                answer = self._run(header, arguments, now_s)
            except scpi.ScpiError as error:
                self._refuse(error)
                continue
            if answer is not None:
                answers.append(answer)
        if not answers:
            return []
        line_out = (";".join(answers) + "\n").encode("ascii")
        # nobody waits for the end of an exposure alone: virtual time must not hurry there while clients speak to others
        is_late = self._free_s - asked_s > _SOON_S
        said: bytes | Later = (lambda due_s: [(due_s, line_out)]) if is_late else line_out
        return [(self._free_s, said)]

    def _refuse(self, error: scpi.ScpiError) -> None:
        self._errors.add(error.number)
        self._events |= _COMMAND_ERROR if error.number > -200 else _EXECUTION_ERROR

    def _run(self, header: str, arguments: list[str], now_s: float) -> str | None:
        if header not in self._commands:
            raise scpi.ScpiError(-113)
        # what can be asked for is set with one argument
        sets = header + "?" in self._commands
        if len(arguments) > (1 if sets or header in _QUERIES_WITH_LIMITS else 0):
            raise scpi.ScpiError(-108)
        if sets and not arguments:
            raise scpi.ScpiError(-109)
        return self._commands[header](arguments, now_s)

    def _start_reading(self, now_s: float) -> _Reading:
        exposure_s = self._average * SAMPLE_S
        self._reading = _Reading(self._head.measure_w(now_s, exposure_s), now_s + exposure_s)
        return self._reading

    def _initiate(self, arguments: list[str], now_s: float) -> None:
        self._start_reading(now_s)

    def _read(self, arguments: list[str], now_s: float) -> str:
        self._start_reading(now_s)
        return self._fetch(arguments, now_s)

    def _fetch(self, arguments: list[str], now_s: float) -> str:
        if self._reading is None:
            raise scpi.ScpiError(-230)
        self._free_s = max(self._free_s, self._reading.ready_s)
        return self._print_power(self._reading.power_w, self._head.zero_w(now_s))

    def _print_power(self, power_w: float, zero_w: float) -> str:
        if power_w == OVER_RANGE:
            return "9.9E+37"
        # without a zero and a loss to correct for, not a bit of the reading changes
        power_w = (power_w - zero_w) * 10 ** (self._loss_db / 10)
        if self._unit == "W":
            return number(power_w)
        return number(10 * math.log10(power_w / 1e-3) if power_w > 0 else _NOT_A_NUMBER)

    def _read_temperature(self, arguments: list[str], now_s: float) -> str:
        # an S120C has no temperature sensor
        raise scpi.ScpiError(-241)

    def _clear_status(self, arguments: list[str], now_s: float) -> None:
        self._errors.clear()
        self._events = 0

    def _operation_complete(self, arguments: list[str], now_s: float) -> str:
        if self._reading is not None:
            self._free_s = max(self._free_s, self._reading.ready_s)
        return "1"

    def _event_status(self, arguments: list[str], now_s: float) -> str:
        events, self._events = self._events, 0
        return str(events)

    def _set_unit(self, arguments: list[str], now_s: float) -> None:
        if arguments[0].upper() not in ("W", "DBM"):
            raise scpi.ScpiError(-224)
        self._unit = arguments[0].upper()

    def _set_range(self, arguments: list[str], now_s: float) -> None:
        self._head.set_range(parse(arguments[0], 0.0, RANGES_W[-1]))

    def _tell_range(self, arguments: list[str], now_s: float) -> str:
        return tell(arguments, self._head.present_range_w(now_s), RANGES_W[0], RANGES_W[-1])

    def _set_auto_range(self, arguments: list[str], now_s: float) -> None:
        self._head.range_w = None if parse_switch(arguments[0]) else self._head.present_range_w(now_s)

    def _set_wavelength(self, arguments: list[str], now_s: float) -> None:
        self._wavelength_nm = parse(arguments[0], 400, 1100)

    def _set_loss(self, arguments: list[str], now_s: float) -> None:
        self._loss_db = parse(arguments[0], -60, 60)

    def _set_average(self, arguments: list[str], now_s: float) -> None:
        self._average = round(parse(arguments[0], 1, 3000))

    def _tell_average(self, arguments: list[str], now_s: float) -> str:
        return str(round(float(tell(arguments, self._average, 1, 3000))))

    def _set_filter(self, arguments: list[str], now_s: float) -> None:
        self._filter = parse_switch(arguments[0])


class _Session:
    def __init__(self, meter: ThorlabsPm100) -> None:
        self._meter = meter
        self._lines = LineSplitter(b"\n", limit=_LONGEST_LINE + 1)

    def receive(self, data: bytes, now_s: float) -> list[Due]:
        """Run every line that is complete."""
        return [reply for line in self._lines.feed(data) for reply in self._meter.execute(line, now_s)]
