"""One motor on a Thorlabs APT controller: what can be asked of it and told it, in counts."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from drivers.thorlabs_apt.messages import (
    ACK_DC_STATUS,
    CHANNEL,
    GET_BACKLASH,
    GET_BAY_USED,
    GET_CHANNEL_ENABLED,
    GET_DC_STATUS,
    GET_HOME_SETTINGS,
    GET_INFO,
    GET_STATUS,
    GET_VELOCITY,
    MOVE_HOME,
    MOVE_STOP,
    RACK,
    REQ_BACKLASH,
    REQ_BAY_USED,
    REQ_CHANNEL_ENABLED,
    REQ_DC_STATUS,
    REQ_HOME_SETTINGS,
    REQ_INFO,
    REQ_STATUS,
    REQ_VELOCITY,
    SET_CHANNEL_ENABLED,
    SINGLE_UNIT,
    STOP_UPDATES,
    Message,
    Velocity,
    backlash_of,
    home_offset_of,
    model_of,
    move_absolute,
    serial_number_of,
    set_backlash,
    set_velocity,
    short_message,
    status_of,
    velocity_of,
)
from drivers.thorlabs_apt.port import AptPort
from drivers.thorlabs_apt.status import AptStatus

T = TypeVar("T")

_ON, _PROFILED, _USED = 1, 2, 1


class AptChannel:
    """The motor of a unit of its own, or of one bay of a rack.

    Parameters
    ----------
    port : AptPort
        The port, which the bays of a rack share.
    name : str
        The device's name, for messages.
    bay : int or None
        The bay of a rack, from 1; None for a unit of its own.
    has_dc_motor : bool
        Whether the controller has the status of DC and brushless motors.
    """

    def __init__(self, port: AptPort, name: str, *, bay: int | None, has_dc_motor: bool) -> None:
        self._port, self._name, self._bay, self._has_dc_motor = port, name, bay, has_dc_motor
        self._address = SINGLE_UNIT if bay is None else 0x20 + bay

    def identity(self) -> tuple[str, int]:
        """The controller's model, such as ``K10CR1``, and its serial number; of a rack, the rack's."""
        unit = SINGLE_UNIT if self._bay is None else RACK
        question = short_message(REQ_INFO, unit)
        return self._port.request(
            self._name, unit, question, GET_INFO, lambda info: (model_of(info), serial_number_of(info))
        )

    def is_present(self) -> bool:
        """Whether the rack says that there is something in this bay; true of a unit of its own."""
        if self._bay is None:
            return True
        question = short_message(REQ_BAY_USED, RACK, self._bay - 1)
        return self._port.request(self._name, RACK, question, GET_BAY_USED, lambda answer: answer.second == _USED)

    def enable(self) -> bool:
        """Switch the motor's power on; returns whether it is on."""
        self._send(short_message(STOP_UPDATES, self._address))  # an earlier program may have asked for them
        self._send(short_message(SET_CHANNEL_ENABLED, self._address, CHANNEL, _ON))
        return self._ask(REQ_CHANNEL_ENABLED, GET_CHANNEL_ENABLED, lambda answer: answer.second == _ON)

    def set_velocity(self, velocity: Velocity) -> Velocity:
        """Set velocity and acceleration; returns what the controller then has."""
        self._send(set_velocity(self._address, velocity))
        return self._ask(REQ_VELOCITY, GET_VELOCITY, velocity_of)

    def set_backlash(self, counts: int) -> int:
        """Set how far the controller goes below a target that it comes to from above; returns what it then has."""
        self._send(set_backlash(self._address, counts))
        return self._ask(REQ_BACKLASH, GET_BACKLASH, backlash_of)

    def home_offset(self) -> int:
        """How far from its switch the zero lies, in counts."""
        return self._ask(REQ_HOME_SETTINGS, GET_HOME_SETTINGS, home_offset_of)

    def status(self) -> AptStatus:
        """Position and status bits."""
        if not self._has_dc_motor:
            return self._ask(REQ_STATUS, GET_STATUS, _status)
        # without it a DC controller stops answering after some seconds
        self._send(short_message(ACK_DC_STATUS, self._address))
        return self._ask(REQ_DC_STATUS, GET_DC_STATUS, _status)

    def take_reports(self) -> tuple[str, ...]:
        """The faults that it, or its rack, has reported of its own accord since it was last asked."""
        return self._port.take_reports(self._address) + self._port.take_reports(RACK)

    def start_homing(self) -> None:
        """Begin to search the home position."""
        self._send(short_message(MOVE_HOME, self._address, CHANNEL))

    def start_move(self, counts: int) -> None:
        """Begin to move to `counts`, which have 32 bits."""
        self._send(move_absolute(self._address, counts))

    def stop(self) -> None:
        """Stop with the set deceleration."""
        self._send(short_message(MOVE_STOP, self._address, CHANNEL, _PROFILED))

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError."""
        self._port.reconnect()

    def close(self) -> None:
        """Close the port; the motor stays powered and holds its position."""
        self._port.close()

    def _send(self, message: bytes) -> None:
        self._port.send(self._name, message)

    def _ask(self, question: int, answer: int, read: Callable[[Message], T]) -> T:
        message = short_message(question, self._address, CHANNEL)
        return self._port.request(self._name, self._address, message, answer, read)


def _status(message: Message) -> AptStatus:
    return AptStatus(*status_of(message))
