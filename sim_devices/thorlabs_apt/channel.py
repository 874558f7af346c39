"""One motor channel of a simulated APT controller: what it answers to the messages for it."""

from __future__ import annotations

import struct
from collections.abc import Callable

from sim_devices.axis import Axis
from sim_devices.thorlabs_apt.messages import CHANNEL, AptMessage
from sim_devices.thorlabs_apt.models import AptModel
from sim_devices.thorlabs_apt.motor import AptMotor
from sim_devices.thorlabs_apt.orders import COUNTS, STOPPED, Announced, AptOrders
from sim_devices.thorlabs_apt.parameters import LIMITS, AptSettings

_GET_ENABLED, _GET_BITS, _GET_STATUS, _GET_SERVO_STATUS = 0x0212, 0x042A, 0x0481, 0x0491
_GET_POSITION, _GET_ENCODER = 0x0412, 0x040B
_FAULT, _RICH_FAULT, _OVERLOAD = 0x0080, 0x0081, 1

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
        self._axis, self._model, self._motor = axis, model, AptMotor(axis, model)
        self._restore()
        self._queries: dict[int, Callable[[AptMessage, float], AptMessage | None]] = {
            0x0211: self._tell_enabled,
            0x040A: self._tell_encoder,
            0x0411: self._tell_position,
            0x0429: self._tell_bits,
            0x0480: self._tell_status,
            0x0490: self._tell_status,
        }

    def _restore(self) -> None:
        self._settings = AptSettings(self._model)
        self._motor.limits.set(self._settings[LIMITS])
        self._orders = AptOrders(self._motor, self._model, self._settings, self._status_data)

    def power_cycle(self, now_s: float) -> None:
        """Lose home, counters and settings; a motion ends at once."""
        self._motor.power_cycle(now_s)
        self._restore()

    def turns(self, axis: Axis) -> bool:
        """Whether this is the channel of that stage."""
        return self._axis is axis

    def lose_home(self, now_s: float) -> None:
        """Forget where home is."""
        self._motor.lose_home(now_s)

    def hit_limit(self, here: AptMessage, now_s: float) -> AptMessage:
        """Meet a limit switch; what is said of it, as an answer to a message from here."""
        self._motor.hit_limit(now_s)
        return here.answer_with_data(STOPPED, self._status_data(now_s))

    def overload(self, here: AptMessage, now_s: float) -> AptMessage:
        """Switch off because of an overload; what is said of it, as an answer to a message from here."""
        self._motor.overload(now_s)
        if self._model.explains_faults:
            return here.answer_with_data(_RICH_FAULT, struct.pack("<HH64s", 0, _OVERLOAD, b"Motor overload"))
        return here.answer(_FAULT)

    def answer(self, request: AptMessage, now_s: float) -> Answer:
        """Carry out a message."""
        if request.channel != CHANNEL:
            return None
        if request.number in self._orders.by_number:
            return self._orders.by_number[request.number](request, now_s)
        if request.number in self._queries:
            return self._queries[request.number](request, now_s)
        answer = self._settings.answer(request)
        self._motor.limits.set(self._settings[LIMITS])
        return answer

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
            return struct.pack("<HiHHI", CHANNEL, position, speed, 0, bits)
        return struct.pack("<HiiI", CHANNEL, position, self._motor.encoder(now_s), bits)

    def _tell_enabled(self, request: AptMessage, now_s: float) -> AptMessage:
        return request.answer(_GET_ENABLED, CHANNEL, 1 if self._motor.is_enabled else 2)

    def _tell_bits(self, request: AptMessage, now_s: float) -> AptMessage:
        return request.answer_with_data(_GET_BITS, struct.pack("<HI", CHANNEL, self._motor.status_bits(now_s)))

    def _tell_status(self, request: AptMessage, now_s: float) -> AptMessage | None:
        is_for_servo = request.number + 1 == _GET_SERVO_STATUS
        return self.status(request, now_s) if is_for_servo == self._model.is_servo else None

    def _tell_position(self, request: AptMessage, now_s: float) -> AptMessage:
        return request.answer_with_data(_GET_POSITION, struct.pack(COUNTS, CHANNEL, self._motor.position(now_s)))

    def _tell_encoder(self, request: AptMessage, now_s: float) -> AptMessage:
        return request.answer_with_data(_GET_ENCODER, struct.pack(COUNTS, CHANNEL, self._motor.encoder(now_s)))
