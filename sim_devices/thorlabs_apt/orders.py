"""What an APT channel does when it is told: motions and their ends, power, and counters that are set."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import NamedTuple

from sim_devices.thorlabs_apt.messages import CHANNEL, AptMessage
from sim_devices.thorlabs_apt.models import AptModel
from sim_devices.thorlabs_apt.motor import AptMotor, Motion
from sim_devices.thorlabs_apt.parameters import ABSOLUTE, HOME, JOG, RELATIVE, REVERSE, VELOCITY, AptSettings

COUNTS = "<Hi"
STOPPED = 0x0466
_HOMED, _COMPLETED = 0x0444, 0x0464
_CONTINUOUS, _AT_ONCE, _ON = 1, 1, 1


class Announced(NamedTuple):
    """What the controller says at `time_s`, unless there is no occasion any more."""

    time_s: float
    say: Callable[[float], AptMessage | None]


class AptOrders:
    """The orders of one channel.

    Parameters
    ----------
    motor : AptMotor
        What carries them out.
    model : AptModel
        The controller's habits.
    settings : AptSettings
        Speeds, steps and stored targets.
    status : callable
        The data of a status message at a time.

    Attributes
    ----------
    by_number : dict of int to callable
        What carries out a message, and returns what is said at once or at the end of it.
    """

    def __init__(
        self, motor: AptMotor, model: AptModel, settings: AptSettings, status: Callable[[float], bytes]
    ) -> None:
        self._motor, self._model, self._settings, self._status = motor, model, settings, status
        self.by_number: dict[int, Callable[[AptMessage, float], AptMessage | Announced | None]] = {
            0x0210: self._enable,
            0x0409: self._set_encoder,
            0x0410: self._set_position,
            0x0443: self._home,
            0x0448: self._move_relative,
            0x0453: self._move_absolute,
            0x0457: self._run,
            0x0465: self._stop,
            0x046A: self._jog,
        }

    def _announce(self, request: AptMessage, motion: Motion, number: int, *, with_status: bool) -> Announced:
        """The message that tells a motion's end, unless another has taken its place by then."""

        def say(time_s: float) -> AptMessage | None:
            if self._motor.motion is not motion:
                return None
            return (
                request.answer_with_data(number, self._status(time_s))
                if with_status
                else request.answer(number, CHANNEL)
            )

        return Announced(motion.end_s, say)

    def _completion(self, request: AptMessage, motion: Motion) -> Announced:
        """A motion that a limit ends is stopped, and not completed."""
        if motion.is_cut_short:
            return self._announce(request, motion, STOPPED, with_status=True)
        return self._announce(request, motion, _COMPLETED, with_status=self._model.completes_with_status)

    def _move_to(self, request: AptMessage, counts: int, now_s: float) -> Announced | None:
        if not self._motor.is_enabled:
            return None
        _, acceleration, velocity = self._settings[VELOCITY]
        was_moving = self._motor.is_moving(now_s)
        motion = self._motor.move_to(counts, now_s, velocity=velocity, acceleration=acceleration)
        is_empty = not was_moving and motion.end_s <= now_s and not motion.is_cut_short
        return None if is_empty and not self._model.completes_empty_moves else self._completion(request, motion)

    def _move_absolute(self, request: AptMessage, now_s: float) -> Announced | None:
        target = self._counts(request, ABSOLUTE)
        return None if target is None else self._move_to(request, target, now_s)

    def _move_relative(self, request: AptMessage, now_s: float) -> Announced | None:
        way = self._counts(request, RELATIVE)
        return None if way is None else self._move_to(request, self._motor.position(now_s) + way, now_s)

    def _counts(self, request: AptMessage, stored: int) -> int | None:
        """The counts in a message, or those set before when it has no data; None when it has others."""
        return self._settings[stored][0] if request.data is None else counts_in(request)

    def _run(self, request: AptMessage, now_s: float) -> Announced | None:
        if not self._motor.is_enabled:
            return None
        _, acceleration, velocity = self._settings[VELOCITY]
        motion = self._motor.run(_sign(request), now_s, velocity=velocity, acceleration=acceleration)
        return self._completion(request, motion)

    def _jog(self, request: AptMessage, now_s: float) -> Announced | None:
        if not self._motor.is_enabled:
            return None
        mode, step, _, acceleration, velocity, _ = self._settings[JOG]
        if mode == _CONTINUOUS:
            motion = self._motor.run(_sign(request), now_s, velocity=velocity, acceleration=acceleration, is_jog=True)
        else:
            target = self._motor.position(now_s) + _sign(request) * step
            motion = self._motor.move_to(target, now_s, velocity=velocity, acceleration=acceleration, is_jog=True)
        return self._completion(request, motion)

    def _home(self, request: AptMessage, now_s: float) -> Announced | None:
        if not self._motor.is_enabled:
            return None
        direction, _, velocity, offset = self._settings[HOME]
        sign, acceleration = -1 if direction == REVERSE else 1, self._settings[VELOCITY][1]
        motion = self._motor.home(sign, offset, now_s, velocity=velocity, acceleration=acceleration)
        return self._announce(request, motion, _HOMED, with_status=False)

    def _stop(self, request: AptMessage, now_s: float) -> AptMessage | Announced:
        if not self._motor.is_moving(now_s):
            return request.answer_with_data(STOPPED, self._status(now_s))
        acceleration = None if request.parameters[1] == _AT_ONCE else self._settings[VELOCITY][1]
        return self._announce(request, self._motor.stop(now_s, acceleration=acceleration), STOPPED, with_status=True)

    def _enable(self, request: AptMessage, now_s: float) -> None:
        self._motor.enable(now_s, is_on=request.parameters[1] == _ON)

    def _set_position(self, request: AptMessage, now_s: float) -> None:
        if (counts := counts_in(request)) is not None:
            self._motor.set_position(counts, now_s)

    def _set_encoder(self, request: AptMessage, now_s: float) -> None:
        if (counts := counts_in(request)) is not None:
            self._motor.set_encoder(counts, now_s)


def counts_in(request: AptMessage) -> int | None:
    """The counts in a message's data; None when they are of another length."""
    if request.data is None or len(request.data) != struct.calcsize(COUNTS):
        return None
    counts: int = struct.unpack(COUNTS, request.data)[1]
    return counts


def _sign(request: AptMessage) -> int:
    return -1 if request.parameters[1] == REVERSE else 1
