"""A simulated Thorlabs APT controller: a single unit on USB, or a rack with a motherboard and up to three bays."""

from __future__ import annotations

import struct
from collections.abc import Mapping

from sim_devices.axis import Axis
from sim_devices.device import Due, Later, Tell, unheard
from sim_devices.serving.baud import SerialLine
from sim_devices.thorlabs_apt.channel import AptChannel
from sim_devices.thorlabs_apt.messages import BAYS, HOST, MOTHERBOARD, SINGLE_UNIT, AptMessage, AptReader
from sim_devices.thorlabs_apt.models import AptModel
from sim_devices.thorlabs_apt.orders import Announced

_BAUDRATE = 115200
_LATENCY_S = 0.002
_UPDATE_S, _UNACKNOWLEDGED_S = 0.1, 5.0

_DISCONNECT, _REQ_INFO, _GET_INFO = 0x0002, 0x0005, 0x0006
_START_UPDATES, _STOP_UPDATES, _ACKNOWLEDGE = 0x0011, 0x0012, 0x0492
_REQ_BAY_USED, _GET_BAY_USED = 0x0060, 0x0061


class ThorlabsApt:
    """A controller with its stages. It answers from the address it is spoken to at; other addresses are not its own.

    Parameters
    ----------
    model : AptModel
        Such as `sim_devices.thorlabs_apt.models.K10CR1`.
    axes : mapping of int to Axis
        What it turns: 1 is the only one of a single unit; of a rack, 1 to 3 are bays.

    Attributes
    ----------
    tell : callable
        Where it reports, at a time, what happens to it.

    Raises
    ------
    ValueError
        When the model has no such bays.
    """

    def __init__(self, model: AptModel, axes: Mapping[int, Axis]) -> None:
        if set(axes) - {1, 2, 3} or not axes or (not model.is_rack and set(axes) != {1}):
            raise ValueError(f"A {model.name} cannot have stages {sorted(axes)}; a single unit has 1, a rack 1 to 3.")
        self.model = model
        self.tell: Tell = unheard
        self._bays = max(axes)
        first = BAYS[0] if model.is_rack else SINGLE_UNIT
        self._channels = {first + number - 1: AptChannel(axis, model) for number, axis in axes.items()}

    def session(self) -> _Session:
        """A new client."""
        return _Session(self)

    def power_cycle(self, now_s: float) -> None:
        """Lose home, counters and settings; motions end at once."""
        for channel in self._channels.values():
            channel.power_cycle(now_s)

    def hit_limit(self, axis: Axis, now_s: float) -> None:
        """Let a stage meet a limit switch."""
        address, channel = self._of(axis)
        self.tell(now_s, channel.hit_limit(_from_host(address), now_s).encode())

    def lose_home(self, axis: Axis, now_s: float) -> None:
        """Let a controller forget where a stage's home is."""
        self._of(axis)[1].lose_home(now_s)

    def overload(self, axis: Axis, now_s: float) -> None:
        """Let a motor be overloaded: it has no power until its channel is enabled again."""
        address, channel = self._of(axis)
        self.tell(now_s, channel.overload(_from_host(address), now_s).encode())

    def _of(self, axis: Axis) -> tuple[int, AptChannel]:
        return next((address, channel) for address, channel in self._channels.items() if channel.turns(axis))

    def channels(self, address: int) -> Mapping[int, AptChannel]:
        """The channels that a message to `address` is for, by their own addresses: all of a rack's, or one, or none."""
        if self.model.is_rack and address == MOTHERBOARD:
            return self._channels
        return {address: self._channels[address]} if address in self._channels else {}

    def answer(self, request: AptMessage, now_s: float) -> AptMessage | Announced | None:
        """Carry out a message; one that is not for this controller, or unknown to it, is ignored."""
        if not self.channels(request.destination):
            return None
        is_for_rack = self.model.is_rack and request.destination == MOTHERBOARD
        if request.number == _REQ_INFO:
            return request.answer_with_data(_GET_INFO, self._info())
        if request.number == _REQ_BAY_USED and is_for_rack:
            is_used = BAYS[0] + request.parameters[0] in self._channels
            return request.answer(_GET_BAY_USED, request.parameters[0], 1 if is_used else 2)
        return None if is_for_rack else self._channels[request.destination].answer(request, now_s)

    def _info(self) -> bytes:
        name = f"{self.model.name}{self._bays}" if self.model.is_rack else self.model.name
        firmware = (3, 0, 2)
        return struct.pack(
            "<I8sHBBBB60sHHH",
            self.model.serial_number,
            name.encode(),
            self.model.hardware_type,
            *firmware,
            0,
            b"simulated APT motor controller",
            1,
            0,
            self._bays,
        )


def _from_host(address: int) -> AptMessage:
    return AptMessage(0, address, HOST)


class _Session:
    def __init__(self, controller: ThorlabsApt) -> None:
        self._controller = controller
        self._reader = AptReader()
        self._to_device, self._to_host = SerialLine(_BAUDRATE), SerialLine(_BAUDRATE)
        self._updates: dict[int, AptMessage] = {}
        self._acknowledged_s = float("-inf")

    def receive(self, data: bytes, now_s: float) -> list[Due]:
        """Carry out every message that is complete."""
        heard_s = self._to_device.carry(len(data), now_s)
        due: list[Due] = []
        for request in self._reader.feed(data, now_s):
            if request.number in (_START_UPDATES, _STOP_UPDATES, _ACKNOWLEDGE, _DISCONNECT):
                due += self._change_updates(request, heard_s)
                continue
            answer = self._controller.answer(request, heard_s)
            if isinstance(answer, Announced):
                due.append((answer.time_s + _LATENCY_S, _later(answer)))
            elif answer is not None:
                reply = answer.encode()
                due.append((self._to_host.carry(len(reply), heard_s + _LATENCY_S), reply))
        return due

    def _change_updates(self, request: AptMessage, now_s: float) -> list[Due]:
        self._acknowledged_s = now_s
        if request.number == _ACKNOWLEDGE:
            return []
        due: list[Due] = []
        for address, channel in self._controller.channels(request.destination).items():
            self._updates.pop(address, None)
            if request.number == _START_UPDATES:
                from_bay = AptMessage(request.number, address, request.source)
                self._updates[address] = from_bay
                due.append((now_s + _UPDATE_S, self._update(from_bay, channel)))
        return due

    def _update(self, wanted: AptMessage, channel: AptChannel) -> Later:
        """Tell the status, and again and again, until it is no longer wanted."""

        def tell(time_s: float) -> list[Due]:
            is_forgotten = self._controller.model.is_servo and time_s - self._acknowledged_s > _UNACKNOWLEDGED_S
            if self._updates.get(wanted.destination) is not wanted or is_forgotten:
                return []
            return [(time_s, channel.status(wanted, time_s).encode()), (time_s + _UPDATE_S, tell)]

        return tell


def _later(answer: Announced) -> Later:
    def say(time_s: float) -> list[Due]:
        message = answer.say(time_s)
        return [] if message is None else [(time_s, message.encode())]

    return say
