"""The settings of an APT channel: their messages, and what they are after power-on."""

from __future__ import annotations

import struct

from sim_devices.thorlabs_apt.messages import CHANNEL, AptMessage
from sim_devices.thorlabs_apt.models import AptModel

REVERSE = 2

# each begins with the channel; the next number asks for what it sets, and the next but one tells it
VELOCITY, JOG, HOME, RELATIVE, ABSOLUTE = 0x0413, 0x0416, 0x0440, 0x0445, 0x0450
LIMITS, POWER, BACKLASH, BUTTONS = 0x0423, 0x0426, 0x043A, 0x04B6
_LAYOUTS = {
    VELOCITY: "<Hiii",
    JOG: "<HHiiiiH",
    LIMITS: "<HHHiiH",
    POWER: "<HHH",
    BACKLASH: "<Hi",
    HOME: "<HHHii",
    RELATIVE: "<Hi",
    ABSOLUTE: "<Hi",
    BUTTONS: "<HHiiHH",
}

# what a hardware switch does, and what a limit in counts does
_IGNORED, _ONLY_FOR_HOMING, _UNLIMITED = 1, 4, 1

Values = tuple[int, ...]


class AptSettings:
    """The settings of one channel, by the number of the message that sets them, without the channel.

    Parameters
    ----------
    model : AptModel
        Whose they are.
    """

    def __init__(self, model: AptModel) -> None:
        self._values = _defaults(model)

    def __getitem__(self, number: int) -> Values:
        """What one message sets."""
        return self._values[number]

    def answer(self, request: AptMessage) -> AptMessage | None:
        """Set what a message sets, unless its data have another length, or tell what it asks for."""
        number, data = request.number, request.data
        if number in _LAYOUTS and data is not None and len(data) == struct.calcsize(_LAYOUTS[number]):
            self._values[number] = struct.unpack(_LAYOUTS[number], data)[1:]
        if number - 1 not in _LAYOUTS:
            return None
        data = struct.pack(_LAYOUTS[number - 1], CHANNEL, *self._values[number - 1])
        return request.answer_with_data(number + 1, data)


def _defaults(model: AptModel) -> dict[int, Values]:
    velocity = round(model.velocity_deg_s * model.velocity_scale)
    home_velocity = round(model.home_velocity_deg_s * model.velocity_scale)
    acceleration = round(model.acceleration_deg_s2 * model.acceleration_scale)
    step, offset = round(5 * model.counts_per_deg), round(model.home_offset_deg * model.counts_per_deg)
    # the stage's one switch is met in reverse
    clockwise = _IGNORED if model.forward_is_clockwise else _ONLY_FOR_HOMING
    counter_clockwise = _ONLY_FOR_HOMING if model.forward_is_clockwise else _IGNORED
    return {
        VELOCITY: (0, acceleration, velocity),
        JOG: (2, step, 0, acceleration, velocity, 2),
        LIMITS: (clockwise, counter_clockwise, 0, 0, _UNLIMITED),
        POWER: (15, 40),
        BACKLASH: (0,),
        HOME: (REVERSE, 1, home_velocity, offset),
        RELATIVE: (step,),
        ABSOLUTE: (0,),
        BUTTONS: (2, step, 0, 1000, 2000),
    }
