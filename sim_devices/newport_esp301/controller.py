"""A simulated Newport ESP301 motion controller: its command language, error queue and timing."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from sim_devices.axis import Axis
from sim_devices.device import Replies
from sim_devices.newport_esp301.axis import Esp301Axis
from sim_devices.newport_esp301.axis_commands import AXIS_COMMANDS
from sim_devices.newport_esp301.errors import Esp301Errors
from sim_devices.newport_esp301.parameter import Esp301Error, to_number
from sim_devices.newport_esp301.stages import URS150CC, Esp301Stage
from sim_devices.serving.baud import SerialLine
from sim_devices.serving.lines import LineSplitter

_LATENCY_S = 0.008
_RESET_S = 3.0
_LONGEST_HOLD_MS = 3_600_000.0
_IDENTITY = "ESP301 Version 3.0.1 6/1/99"
_COMMAND = re.compile(r"(\d*)([A-Z]{2})(.*)")


class NewportEsp301:
    """A controller with up to three axes; every motor starts without power.

    One interpreter works through the commands of all clients in order. A hold (WS, WP, WT) keeps it from the commands
    behind, which then run at the moment the hold ends.

    Parameters
    ----------
    axes : mapping of int to Axis
        The stages that are connected, by axis number 1 to 3.
    stage : Esp301Stage
        Their model.
    switches_deg : float
        Where each has a limit switch on either side; infinite for stages that turn without end.
    baudrate : int
        Of the serial line: 921600 on USB, 19200 on RS-232.
    line_limit : int
        Characters that a line of commands may have.
    tick_s : float
        In which the times of errors are counted.
    """

    def __init__(
        self,
        axes: Mapping[int, Axis],
        *,
        stage: Esp301Stage = URS150CC,
        switches_deg: float = 175.0,
        baudrate: int = 921_600,
        line_limit: int = 80,
        tick_s: float = 400e-6,
    ) -> None:
        self._axes = {number: Esp301Axis(axis, stage, switches_deg) for number, axis in axes.items()}
        self.line_limit = line_limit
        self._inward, self._outward = SerialLine(baudrate), SerialLine(baudrate)
        self._errors = Esp301Errors(tick_s)
        self._free_s = 0.0
        self._for_all: dict[str, Callable[[str, float], str | None]] = {
            "VE": lambda _, now_s: _IDENTITY,
            "TE": lambda _, now_s: self._errors.next_number(now_s),
            "TB": lambda _, now_s: self._errors.next_text(now_s),
            "TS": self._status,
            "AB": self._abort,
            "RS": self._reset,
            "WT": self._wait,
        }
        self._for_any: dict[str, Callable[[list[Esp301Axis], str, float], None]] = {
            "ST": self._stop,
            "WS": self._wait_for_stop,
        }

    def session(self) -> _Session:
        """A new client."""
        return _Session(self)

    def power_cycle(self, now_s: float) -> None:
        """Begin afresh, and count from 0 wherever the axes stand."""
        self.reset(now_s)
        for axis in self._axes.values():
            axis.lose_home(now_s)

    def reset(self, now_s: float) -> None:
        """Begin afresh, as told by RS: axes stop, motors are off, settings are those of the factory."""
        self._reset("", now_s)

    def hit_limit(self, axis: Axis, now_s: float) -> None:
        """Let a stage meet its limit switch."""
        self._of(axis).hit_limit(now_s)

    def lose_home(self, axis: Axis, now_s: float) -> None:
        """Let a stage's position be 0 where it stands, as another program's DH does."""
        self._of(axis).lose_home(now_s)

    def _of(self, axis: Axis) -> Esp301Axis:
        return next(of_controller for of_controller in self._axes.values() if of_controller.turns(axis))

    def execute(self, line: str, arrival_s: float) -> Replies:
        """Run the commands of one line as soon as the interpreter is free."""
        arrival_s = self._inward.carry(len(line) + 1, arrival_s)
        if len(line) > self.line_limit:
            self._errors.add(6, max(arrival_s, self._free_s))
            return []
        replies: Replies = []
        for command in re.sub(r"\s", "", line).upper().split(";"):
            now_s = self._free_s = max(arrival_s, self._free_s)
            self._take_motion_errors(now_s)
            answer = self._run(command, now_s) if command else None
            if answer is not None:
                self._free_s = now_s + _LATENCY_S
                reply = f"{answer}\r\n".encode("ascii")
                replies.append((self._outward.carry(len(reply), self._free_s), reply))
        return replies

    def _run(self, command: str, now_s: float) -> str | None:
        try:
            return self._dispatch(command, now_s)
        except Esp301Error as error:
            self._errors.add(error.code, now_s)
            return None

    def _dispatch(self, command: str, now_s: float) -> str | None:
        parts = _COMMAND.fullmatch(command)
        if parts is None:
            raise Esp301Error(6)
        number, mnemonic, parameter = parts.groups()
        if mnemonic in self._for_all:
            return self._for_all[mnemonic](parameter, now_s)
        if mnemonic in self._for_any and not number:
            self._for_any[mnemonic](list(self._axes.values()), parameter, now_s)
            return None
        if mnemonic not in self._for_any and mnemonic not in AXIS_COMMANDS and mnemonic != "WP":
            raise Esp301Error(6)
        if not number:
            raise Esp301Error(37)
        if not 1 <= int(number) <= 3:
            raise Esp301Error(9)
        return self._dispatch_to_axis(int(number), mnemonic, parameter, now_s)

    def _dispatch_to_axis(self, number: int, mnemonic: str, parameter: str, now_s: float) -> str | None:
        axis = self._axes.get(number)
        if axis is None:
            if (mnemonic, parameter) in _WITHOUT_STAGE:
                return _WITHOUT_STAGE[mnemonic, parameter]
            raise Esp301Error(100 * number + 8)
        try:
            if mnemonic in self._for_any:
                self._for_any[mnemonic]([axis], parameter, now_s)
                return None
            if mnemonic == "WP":
                self._free_s = axis.passes_at(to_number(parameter) * axis.settings.deg_per_unit, now_s)
                return None
            return AXIS_COMMANDS[mnemonic](axis, mnemonic, parameter, now_s)
        except Esp301Error as error:
            raise Esp301Error(100 * number + error.code) if error.of_axis else error from None

    def _take_motion_errors(self, now_s: float) -> None:
        """Queue what motions that have ended by now have run into."""
        for number, axis in self._axes.items():
            for error, time_s in axis.finish_motion(now_s):
                self._errors.add(100 * number + error, time_s)

    def _status(self, _: str, now_s: float) -> str:
        moving = sum(1 << (number - 1) for number, axis in self._axes.items() if axis.is_busy(now_s))
        powered = any(axis.powered for axis in self._axes.values())
        return chr(0x40 | moving | (0x10 if powered else 0))

    def _stop(self, axes: list[Esp301Axis], _: str, now_s: float) -> None:
        for axis in axes:
            axis.stop(now_s)

    def _abort(self, _: str, now_s: float) -> None:
        for axis in self._axes.values():
            axis.power_off(now_s)
        self._errors.add(4, now_s)

    def _reset(self, _: str, now_s: float) -> None:
        for axis in self._axes.values():
            axis.reset(now_s)
        self._errors.clear()
        self._free_s = now_s + _RESET_S

    def _wait(self, parameter: str, now_s: float) -> None:
        self._free_s = now_s + _hold_s(parameter, missing_is_zero=False)

    def _wait_for_stop(self, axes: list[Esp301Axis], parameter: str, now_s: float) -> None:
        hold_s = _hold_s(parameter, missing_is_zero=True)
        self._free_s = max([now_s, *(axis.busy_until_s for axis in axes)]) + hold_s


# what an axis answers that has no stage
_WITHOUT_STAGE = {("ID", "?"): ", ", ("MO", "?"): "0", ("MD", "?"): "1", ("QM", "?"): "0"}


def _hold_s(parameter: str, *, missing_is_zero: bool) -> float:
    if missing_is_zero and not parameter:
        return 0.0
    hold_ms = to_number(parameter)
    if not 0 <= hold_ms <= _LONGEST_HOLD_MS:
        raise Esp301Error(7)
    return hold_ms / 1000


class _Session:
    def __init__(self, controller: NewportEsp301) -> None:
        self._controller = controller
        self._lines = LineSplitter(b"\r", limit=controller.line_limit + 1)

    def receive(self, data: bytes, now_s: float) -> Replies:
        """Run every line that is complete; a line feed after the carriage return is dropped."""
        lines = self._lines.feed(data.replace(b"\n", b""))
        return [reply for line in lines for reply in self._controller.execute(line, now_s)]
