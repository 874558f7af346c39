"""One motor channel of a simulated APT controller: what it answers to the messages for it."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import ClassVar, NamedTuple

from sim_devices.axis import Axis
from sim_devices.thorlabs_apt.messages import AptMessage
from sim_devices.thorlabs_apt.models import AptModel
from sim_devices.thorlabs_apt.motor import AptMotor, Motion

_CHANNEL = 1
_REVERSE = 2

# each begins with the channel; the next number asks for what it sets, and the next but one tells it
_VELOCITY, _JOG, _HOME, _RELATIVE, _ABSOLUTE = 0x0413, 0x0416, 0x0440, 0x0445, 0x0450
_LIMIT_SWITCHES, _POWER, _BACKLASH, _BUTTONS = 0x0423, 0x0426, 0x043A, 0x04B6
_PARAMETERS = {
    _VELOCITY: "<Hiii",
    _JOG: "<HHiiiiH",
    _LIMIT_SWITCHES: "<HHHiiH",
    _POWER: "<HHH",
    _BACKLASH: "<Hi",
    _HOME: "<HHHii",
    _RELATIVE: "<Hi",
    _ABSOLUTE: "<Hi",
    _BUTTONS: "<HHiiHH",
}
_COUNTS = "<Hi"
_GET_ENABLED, _GET_BITS, _GET_STATUS, _GET_SERVO_STATUS = 0x0212, 0x042A, 0x0481, 0x0491
_HOMED, _COMPLETED, _STOPPED = 0x0444, 0x0464, 0x0466


class Announced(NamedTuple):
    """What the controller says at `time_s`, unless there is no occasion any more."""

    time_s: float
    say: Callable[[float], AptMessage | None]


Answer = AptMessage | Announced | None


class AptChannel:
    """A channel with its stage. What it does not know, and what is not for channel 1, it ignores.

    Parameters
    ----------
    axis : Axis
        What it turns.
    model : AptModel
        The stage's scales and the controller's habits.
    """

    def __init__(self, axis: Axis, model: AptModel) -> None:
        self._model = model
        self._motor = AptMotor(axis, model)
        self._parameters = _defaults(model)

    def power_cycle(self, now_s: float) -> None:
        """Lose home, counters and settings; a motion ends at once."""
        self._motor.power_cycle(now_s)
        self._parameters = _defaults(self._model)

    def answer(self, request: AptMessage, now_s: float) -> Answer:
        """Carry out a message."""
        number, data = request.number, request.data
        if request.channel != _CHANNEL:
            return None
        if number in _PARAMETERS and data is not None:
            if len(data) == struct.calcsize(_PARAMETERS[number]):
                self._parameters[number] = struct.unpack(_PARAMETERS[number], data)[1:]
            return None
        if number - 1 in _PARAMETERS:
            values = self._parameters[number - 1]
            return request.answer_with_data(number + 1, struct.pack(_PARAMETERS[number - 1], _CHANNEL, *values))
        handler = self.HANDLERS.get(number)
        return handler(self, request, now_s) if handler else None

    def status(self, request: AptMessage, now_s: float) -> AptMessage:
        """The status update that this kind of controller sends."""
        return request.answer_with_data(
            _GET_SERVO_STATUS if self._model.is_servo else _GET_STATUS, self._status_data(now_s)
        )

    def _status_data(self, now_s: float) -> bytes:
        position, bits = self._motor.position(now_s), self._motor.status_bits(now_s)
        if self._model.is_servo:
            # whole encoder steps a sampling interval; the motor's current is not simulated
            speed = min(self._motor.speed_word(now_s) >> 16, 0xFFFF)
            return struct.pack("<HiHHI", _CHANNEL, position, speed, 0, bits)
        return struct.pack("<HiiI", _CHANNEL, position, self._motor.encoder(now_s), bits)

    def _announce(self, request: AptMessage, motion: Motion, number: int, *, with_status: bool) -> Announced:
        """The message that tells a motion's end, unless another has taken its place by then."""

        def say(time_s: float) -> AptMessage | None:
            if self._motor.motion is not motion:
                return None
            if with_status:
                return request.answer_with_data(number, self._status_data(time_s))
            return request.answer(number, _CHANNEL)

        return Announced(motion.end_s, say)

    def _completion(self, request: AptMessage, motion: Motion) -> Announced:
        return self._announce(request, motion, _COMPLETED, with_status=self._model.completes_with_status)

    def _move_to(self, request: AptMessage, counts: int, now_s: float) -> Answer:
        if not self._motor.is_enabled:
            return None
        _, acceleration, velocity = self._parameters[_VELOCITY]
        was_moving = self._motor.is_moving(now_s)
        motion = self._motor.move_to(counts, now_s, velocity=velocity, acceleration=acceleration)
        if not was_moving and motion.end_s <= now_s and not self._model.completes_empty_moves:
            return None
        return self._completion(request, motion)

    def _move_absolute(self, request: AptMessage, now_s: float) -> Answer:
        target = self._counts(request, _ABSOLUTE)
        return None if target is None else self._move_to(request, target, now_s)

    def _move_relative(self, request: AptMessage, now_s: float) -> Answer:
        way = self._counts(request, _RELATIVE)
        return None if way is None else self._move_to(request, self._motor.position(now_s) + way, now_s)

    def _counts(self, request: AptMessage, stored: int) -> int | None:
        """The counts in a message, or those set before when it has no data; None when it has others."""
        if request.data is None:
            return self._parameters[stored][0]
        if len(request.data) != struct.calcsize(_COUNTS):
            return None
        counts: int = struct.unpack(_COUNTS, request.data)[1]
        return counts

    def _run(self, request: AptMessage, now_s: float) -> Answer:
        if not self._motor.is_enabled:
            return None
        _, acceleration, velocity = self._parameters[_VELOCITY]
        motion = self._motor.run(_sign(request), now_s, velocity=velocity, acceleration=acceleration)
        return self._completion(request, motion)

    def _jog(self, request: AptMessage, now_s: float) -> Answer:
        if not self._motor.is_enabled:
            return None
        mode, step, _, acceleration, velocity, _ = self._parameters[_JOG]
        if mode == 1:
            motion = self._motor.run(_sign(request), now_s, velocity=velocity, acceleration=acceleration, is_jog=True)
        else:
            target = self._motor.position(now_s) + _sign(request) * step
            motion = self._motor.move_to(target, now_s, velocity=velocity, acceleration=acceleration, is_jog=True)
        return self._completion(request, motion)

    def _home(self, request: AptMessage, now_s: float) -> Answer:
        if not self._motor.is_enabled:
            return None
        direction, _, velocity, offset = self._parameters[_HOME]
        sign, acceleration = -1 if direction == _REVERSE else 1, self._parameters[_VELOCITY][1]
        motion = self._motor.home(sign, offset, now_s, velocity=velocity, acceleration=acceleration)
        return self._announce(request, motion, _HOMED, with_status=False)

    def _stop(self, request: AptMessage, now_s: float) -> Answer:
        if not self._motor.is_moving(now_s):
            return request.answer_with_data(_STOPPED, self._status_data(now_s))
        is_abrupt = request.parameters[1] == 1
        motion = self._motor.stop(now_s, acceleration=None if is_abrupt else self._parameters[_VELOCITY][1])
        return self._announce(request, motion, _STOPPED, with_status=True)

    def _enable(self, request: AptMessage, now_s: float) -> None:
        self._motor.is_enabled = request.parameters[1] == 1
        if not self._motor.is_enabled and self._motor.is_moving(now_s):
            self._motor.stop(now_s, acceleration=None)

    def _tell_enabled(self, request: AptMessage, now_s: float) -> AptMessage:
        return request.answer(_GET_ENABLED, _CHANNEL, 1 if self._motor.is_enabled else 2)

    def _tell_bits(self, request: AptMessage, now_s: float) -> AptMessage:
        return request.answer_with_data(_GET_BITS, struct.pack("<HI", _CHANNEL, self._motor.status_bits(now_s)))

    def _tell_status(self, request: AptMessage, now_s: float) -> AptMessage | None:
        is_for_servo = request.number + 1 == _GET_SERVO_STATUS
        return self.status(request, now_s) if is_for_servo == self._model.is_servo else None

    def _set_position(self, request: AptMessage, now_s: float) -> None:
        if request.data is not None and len(request.data) == struct.calcsize(_COUNTS):
            self._motor.set_position(struct.unpack(_COUNTS, request.data)[1], now_s)

    def _set_encoder(self, request: AptMessage, now_s: float) -> None:
        if request.data is not None and len(request.data) == struct.calcsize(_COUNTS):
            self._motor.set_encoder(struct.unpack(_COUNTS, request.data)[1], now_s)

    def _tell_position(self, request: AptMessage, now_s: float) -> AptMessage:
        return request.answer_with_data(0x0412, struct.pack(_COUNTS, _CHANNEL, self._motor.position(now_s)))

    def _tell_encoder(self, request: AptMessage, now_s: float) -> AptMessage:
        return request.answer_with_data(0x040B, struct.pack(_COUNTS, _CHANNEL, self._motor.encoder(now_s)))

    HANDLERS: ClassVar[dict[int, Callable[[AptChannel, AptMessage, float], Answer]]] = {
        0x0210: _enable,
        0x0211: _tell_enabled,
        0x0409: _set_encoder,
        0x040A: _tell_encoder,
        0x0410: _set_position,
        0x0411: _tell_position,
        0x0429: _tell_bits,
        0x0443: _home,
        0x0448: _move_relative,
        0x0453: _move_absolute,
        0x0457: _run,
        0x0465: _stop,
        0x046A: _jog,
        0x0480: _tell_status,
        0x0490: _tell_status,
    }


def _sign(request: AptMessage) -> int:
    return -1 if request.parameters[1] == _REVERSE else 1


def _defaults(model: AptModel) -> dict[int, tuple[int, ...]]:
    """Settings after power-on, in the order of their messages, without the channel."""
    velocity = round(model.velocity_deg_s * model.velocity_scale)
    home_velocity = round(model.home_velocity_deg_s * model.velocity_scale)
    acceleration = round(model.acceleration_deg_s2 * model.acceleration_scale)
    step, offset = round(5 * model.counts_per_deg), round(model.home_offset_deg * model.counts_per_deg)
    return {
        _VELOCITY: (0, acceleration, velocity),
        _JOG: (2, step, 0, acceleration, velocity, 2),
        _LIMIT_SWITCHES: (4, 1, 0, 0, 1),
        _POWER: (15, 40),
        _BACKLASH: (0,),
        _HOME: (_REVERSE, 1, home_velocity, offset),
        _RELATIVE: (step,),
        _ABSOLUTE: (0,),
        _BUTTONS: (2, step, 0, 1000, 2000),
    }
