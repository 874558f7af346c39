"""A simulated Stanford Research SR830 lock-in amplifier at its RS-232 port: commands, status and timing."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable

from sim_devices.device import Replies
from sim_devices.light import ChoppedLight
from sim_devices.serving.baud import SerialLine
from sim_devices.serving.lines import LineSplitter
from sim_devices.stanford_sr830.lock_in import Event, LockIn
from sim_devices.stanford_sr830.outputs import Sr830Outputs
from sim_devices.stanford_sr830.parameters import BadParameterError, numbers, place, require, text, told
from sim_devices.stanford_sr830.settings import SENSITIVITIES_V, SETTINGS, wrapped_deg

_IDENTITY = "Stanford_Research_Systems,SR830,s/n12345,ver1.07"
_LATENCY_S = 0.004
_AUTO_S = 1.0
_LONGEST_LINE = 256
_HIGHEST_HZ = 102_000.0
# as many of their commands as the input buffer holds
_MOST_AUTOS = _LONGEST_LINE // 5
_COMMAND = re.compile(r"(\*[A-Z]{3}|[A-Z]{4})(\??)(.*)", re.ASCII)

_BAD_PARAMETER, _UNKNOWN_COMMAND, _POWER_ON = 1 << 4, 1 << 5, 1 << 7
_IDLE, _LOCK_IN_EVENT = 1 << 1, 1 << 3


class StanfordSr830:
    """A lock-in whose detector, at input A, looks at a chopped light; switched on with its standard settings.

    One interpreter works through the commands of all clients in order. Filter overload, trigger and changes of the time
    constant are never reported; reserve, line filters and synchronous filter make no difference, and the coupling only
    to what overloads the input.

    Parameters
    ----------
    light : ChoppedLight
        What the detector tells; asked for the last 25 time constants as well.
    volts_per_watt : float
        Rms voltage at the fundamental of the chopped light, for each watt while the chopper is open.
    phase_deg : float
        Of the signal against the chopper's reference.
    chopper_hz : float
        Frequency of the chopper at the reference input.
    baudrate : int
        Of the serial line.
    answers_at_gpib : bool
        Whether it is switched on with its answers going to GPIB, where nobody sees them until ``OUTX 0``.
    """

    def __init__(
        self,
        light: ChoppedLight,
        *,
        volts_per_watt: float = 1e5,
        phase_deg: float = 0.0,
        chopper_hz: float = 173.0,
        baudrate: int = 9600,
        answers_at_gpib: bool = False,
    ) -> None:
        self._settings = {name: setting.default for name, setting in SETTINGS.items()}
        self._settings["OUTX"] = float(answers_at_gpib)
        self._lock_in = LockIn(light, self._settings, volts_per_watt, phase_deg, chopper_hz)
        self._outputs = outputs = Sr830Outputs(self._lock_in)
        self._events = _POWER_ON
        self._inward, self._outward = SerialLine(baudrate), SerialLine(baudrate)
        self._free_s = 0.0
        self._autos: deque[tuple[float, Callable[[float], None]]] = deque()
        self._queries: dict[str, Callable[[list[float], float], str]] = {
            "*IDN": self._identity,
            "*ESR": self._event_status,
            "*STB": self._status_byte,
            "LIAS": self._lock_in_status,
            "OUTP": outputs.tell_output,
            "SNAP": outputs.tell_snapshot,
            "OAUX": outputs.tell_aux_input,
            "AUXV": outputs.tell_aux_output,
            "OEXP": outputs.tell_offset,
            "FREQ": self._frequency,
        }
        self._orders: dict[str, Callable[[list[float], float], None]] = {
            "*RST": self._reset,
            "*CLS": self._clear,
            "AUXV": outputs.set_aux_output,
            "OEXP": outputs.set_offset,
            "APHS": lambda parameters, now_s: self._begin_auto(self._auto_phase, parameters, now_s),
            "AGAN": lambda parameters, now_s: self._begin_auto(self._auto_gain, parameters, now_s),
            "ARSV": lambda parameters, now_s: self._begin_auto(self._auto_reserve, parameters, now_s),
            "AOFF": self._begin_auto_offset,
        }

    def session(self) -> _Session:
        """A new client."""
        return _Session(self)

    def power_cycle(self, now_s: float) -> None:
        """Begin afresh with the settings that it had, which a battery keeps."""
        self._autos.clear()
        self._events, self._free_s = _POWER_ON, now_s
        self._lock_in.restart(now_s)

    def set_chopper(self, frequency_hz: float, now_s: float) -> None:
        """Let the chopper run at another frequency, or stand at 0."""
        self._lock_in.set_chopper(frequency_hz, now_s)

    def execute(self, line: str, arrival_s: float) -> Replies:
        """Run the commands of one line once it has come through the serial line and the device is free."""
        begin_s = self._inward.carry(len(line) + 1, arrival_s)
        if len(line) > _LONGEST_LINE:
            self._events |= _UNKNOWN_COMMAND
            return []
        replies: Replies = []
        for command in filter(None, re.sub(r"\s", "", line).upper().split(";")):
            now_s = self._free_s = max(begin_s, self._free_s) + _LATENCY_S
            self._finish_autos(now_s)
            self._lock_in.watch(now_s)
            answer = self._run(command, now_s)
            if answer is not None and not self._settings["OUTX"]:
                reply = f"{answer}\r".encode("ascii")
                replies.append((self._outward.carry(len(reply), now_s), reply))
        return replies

    def _run(self, command: str, now_s: float) -> str | None:
        parts = _COMMAND.fullmatch(command)
        name, query, rest = parts.groups() if parts else ("", "", "")
        try:
            if query and name in self._queries:
                return self._queries[name](numbers(rest), now_s)
            if query and name in SETTINGS:
                require(not rest)
                return text(self._settings[name])
            if not query and name in self._orders:
                self._orders[name](numbers(rest), now_s)
            elif not query and name in SETTINGS:
                self._set(name, numbers(rest), now_s)
            else:
                self._events |= _UNKNOWN_COMMAND
        except BadParameterError:
            self._events |= _BAD_PARAMETER
        return None

    def _set(self, name: str, parameters: list[float], now_s: float) -> None:
        require(len(parameters) == 1)
        value = SETTINGS[name].take(parameters[0])
        if name == "FREQ":
            require(self._settings["FMOD"] == 1 and value * self._settings["HARM"] <= _HIGHEST_HZ)
        elif name == "HARM":
            require(value * self._lock_in.outputs(now_s).frequency_hz <= _HIGHEST_HZ)
        elif name == "PHAS":
            value = wrapped_deg(value)
        if self._settings[name] == value:
            return
        self._settings[name] = value
        if name in ("OFLT", "OFSL"):
            self._lock_in.filter_changed()
        elif name == "FMOD":
            self._lock_in.reference_changed(now_s)
        elif name in ("FREQ", "HARM"):
            self._lock_in.frequency_changed()

    def _identity(self, parameters: list[float], now_s: float) -> str:
        require(not parameters)
        return _IDENTITY

    def _frequency(self, parameters: list[float], now_s: float) -> str:
        require(not parameters)
        return text(self._lock_in.outputs(now_s).frequency_hz)

    def _event_status(self, parameters: list[float], now_s: float) -> str:
        answer, self._events = told(self._events, parameters)
        return answer

    def _lock_in_status(self, parameters: list[float], now_s: float) -> str:
        answer, left = told(int(self._lock_in.events), parameters)
        self._lock_in.events = Event(left)
        return answer

    def _status_byte(self, parameters: list[float], now_s: float) -> str:
        byte = (0 if self._autos else _IDLE) | (_LOCK_IN_EVENT if self._lock_in.events else 0)
        return told(byte, parameters)[0]

    def _reset(self, parameters: list[float], now_s: float) -> None:
        """Standard settings; where the answers go stays as it is."""
        require(not parameters)
        self._autos.clear()
        self._outputs.reset()
        self._settings |= {name: setting.default for name, setting in SETTINGS.items() if name != "OUTX"}
        self._lock_in.filter_changed()
        self._lock_in.reference_changed(now_s)

    def _clear(self, parameters: list[float], now_s: float) -> None:
        require(not parameters)
        self._events = 0
        self._lock_in.events = Event(0)

    def _begin_auto(self, finish: Callable[[float], None], parameters: list[float], now_s: float) -> None:
        """One after the other; each takes as long as the filter needs to settle, and a second."""
        require(not parameters)
        begin_s = self._autos[-1][0] if self._autos else now_s
        if len(self._autos) < _MOST_AUTOS:
            self._autos.append((begin_s + _AUTO_S + self._lock_in.settling_s(), finish))

    def _finish_autos(self, now_s: float) -> None:
        while self._autos and self._autos[0][0] <= now_s:
            end_s, finish = self._autos.popleft()
            self._lock_in.watch(end_s)
            finish(end_s)

    def _auto_phase(self, now_s: float) -> None:
        self._settings["PHAS"] = wrapped_deg(round(self._settings["PHAS"] + self._lock_in.outputs(now_s).theta, 2))

    def _auto_gain(self, now_s: float) -> None:
        # at the largest sensitivity nothing is cut off
        self._settings["SENS"] = len(SENSITIVITIES_V) - 1
        magnitude_v = self._lock_in.outputs(now_s).r
        self._settings["SENS"] = sum(full_scale_v < magnitude_v for full_scale_v in SENSITIVITIES_V[:-1])

    def _auto_reserve(self, now_s: float) -> None:
        self._settings["RMOD"] = SETTINGS["RMOD"].high

    def _begin_auto_offset(self, parameters: list[float], now_s: float) -> None:
        channel = place(parameters, 3)
        self._begin_auto(lambda end_s: self._outputs.offset_to_zero(channel, end_s), [], now_s)


class _Session:
    def __init__(self, device: StanfordSr830) -> None:
        self._device = device
        self._lines = LineSplitter(b"\r", limit=_LONGEST_LINE + 1)

    def receive(self, data: bytes, now_s: float) -> Replies:
        """Run every line that is complete; carriage return and line feed both end one."""
        lines = self._lines.feed(data.replace(b"\n", b"\r"))
        return [reply for line in lines for reply in self._device.execute(line, now_s)]
