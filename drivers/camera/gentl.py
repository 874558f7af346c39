"""One camera behind a GenTL transport library, through `harvesters`: its features and its pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.camera import genicam_errors as errors

_POLL_S = 0.001
"""As long as a picture is waited for when one is asked for; harvesters would take 0 for ever."""

_SAME = 1e-3


@dataclass(frozen=True)
class Library:
    """What is used of harvesters.

    Parameters
    ----------
    harvester : callable
        Makes a `Harvester`.
    errors : tuple of exception types
        What GenTL and GenApi raise.
    on_incomplete : callable
        Lets an acquirer call a function when a picture has come incomplete, which it keeps to itself otherwise.
    is_available : callable
        Whether a node is more than a name: cameras of a series share descriptions, and not all have all of it.
    """

    harvester: Callable[[], Any]
    errors: tuple[type[Exception], ...]
    on_incomplete: Callable[[Any, Callable[[], None]], None]
    is_available: Callable[[Any], bool]


def harvesters() -> Library:
    """The library as it is installed; raises ImportError when it is not."""
    core: Any = import_module("harvesters.core")
    gentl: Any = import_module("genicam.gentl")
    genapi: Any = import_module("genicam.genapi")

    def on_incomplete(acquirer: Any, function: Callable[[], None]) -> None:
        class Told(core.Callback):  # type: ignore[misc]  # the library calls nothing else
            def emit(self, context: object = None) -> None:
                function()

        acquirer.add_callback(acquirer.Events.INCOMPLETE_BUFFER, Told())

    return Library(
        core.Harvester, (gentl.GenericException, genapi.GenericException), on_incomplete, genapi.is_available
    )


@dataclass(frozen=True, eq=False)
class Fetched:
    """A picture, with its pixel format, the camera's number of it, and its time on the camera's clock if it says so."""

    counts: NDArray[np.uint16]
    pixel_format: str
    frame_id: int
    stamp_ns: int | None


class GentlCamera:
    """An opened camera.

    Parameters
    ----------
    name : str
        The device's name in the rig file, for messages.
    transport_library : str
        Path of the maker's .cti file.
    serial_number : str
        Of the camera.
    load : callable
        Loads harvesters.

    Attributes
    ----------
    identity : str
        Maker, model and serial number.
    incomplete_frames : int
        Pictures of which a part was lost.

    Raises
    ------
    NotConnectedError
        From everything: when the library or the camera is not there, or is gone.
    """

    def __init__(
        self, name: str, transport_library: str, serial_number: str, load: Callable[[], Library] = harvesters
    ) -> None:
        self.name, self.incomplete_frames = name, 0
        if not Path(transport_library).is_file():
            raise errors.no_transport_library(name, transport_library)
        try:
            self._library = load()
        except ImportError as error:
            raise errors.not_installed(name) from error
        with ExitStack() as opened, self._talking("it could not be opened"):
            harvester = self._library.harvester()
            opened.callback(harvester.reset)
            harvester.add_file(transport_library)
            harvester.update()
            there = {self._serial_number(device): device for device in harvester.device_info_list}
            if serial_number not in there:
                raise errors.not_there(name, serial_number, [serial for serial in there if serial])
            device = there[serial_number]
            self.identity = f"{device.vendor} {device.model} {serial_number}"
            self._acquirer = harvester.create(device)
            opened.callback(self._acquirer.destroy)
            self._library.on_incomplete(self._acquirer, self._count_incomplete)
            self._opened = opened.pop_all()

    def has(self, feature: str) -> bool:
        """Whether the camera has a feature, by its name in the Standard Features Naming Convention."""
        with self._talking(f"{feature} could not be asked for"):
            node_map = self._acquirer.remote_device.node_map
            return bool(node_map.has_node(feature)) and self._library.is_available(getattr(node_map, feature))

    def get(self, feature: str) -> Any:
        """What a feature is set to."""
        with self._talking(f"{feature} could not be read"):
            return self._node(feature).value

    def limits(self, feature: str) -> tuple[float, float]:
        """Least and greatest value of a number."""
        with self._talking(f"the limits of {feature} could not be read"):
            node = self._node(feature)
            return float(node.min), float(node.max)

    def set(self, feature: str, value: str | float) -> None:
        """Set a feature that has another value, and read it back.

        Raises
        ------
        DeviceFaultError
            When the camera does not take it.
        """
        try:
            node = self._node(feature)
            if not _is_same(node.value, value):  # one that cannot be changed may be as it should
                node.value = value
            held = node.value
        except self._library.errors as error:
            raise errors.not_taken(self.name, feature, value, str(error)) from error
        if not _is_same(held, value):
            raise errors.not_taken(self.name, feature, value, f"it holds {held}")

    def settled(self, feature: str, value: float) -> float:
        """Set a number that comes in steps, and return what the camera has made of it."""
        with self._talking(f"{feature} could not be set"):
            node = self._node(feature)
            node.value = value
            return float(node.value)

    def execute(self, command: str) -> None:
        """Give a command."""
        with self._talking(f"{command} could not be given"):
            self._node(command).execute()

    def start(self) -> None:
        """Let pictures come."""
        with self._talking("taking pictures could not be begun"):
            self._acquirer.start()

    def stop(self) -> None:
        """Let none come any more; those that wait are thrown away."""
        with self._talking("taking pictures could not be ended"):
            self._acquirer.stop()

    def fetch(self) -> Fetched | None:
        """The next whole picture, if there is one now."""
        with self._talking("no picture could be fetched"):
            buffer = self._acquirer.try_fetch(timeout=_POLL_S)
            if buffer is None:
                return None
            with buffer:  # at its end the library has its memory back, whatever happens
                component = buffer.payload.components[0]
                width, height, data = int(component.width), int(component.height), component.data
                if data.size != width * height:  # lines with padding are left as they are, and so are packed formats
                    raise errors.not_an_image(self.name, data.size, width, height)
                counts = data.reshape(height, width).astype(np.uint16)
                return Fetched(counts, component.data_format, int(buffer.module.frame_id), self._stamp_ns(buffer))

    def close(self) -> None:
        """Let go of it, even if it is gone."""
        with suppress(*self._library.errors):  # one that was unplugged does not answer, and has let go already
            self._opened.close()

    def _node(self, feature: str) -> Any:
        node_map = self._acquirer.remote_device.node_map
        if not node_map.has_node(feature):
            raise errors.no_feature(self.name, feature)
        return getattr(node_map, feature)

    def _count_incomplete(self) -> None:
        self.incomplete_frames += 1

    def _serial_number(self, device: Any) -> str:
        try:
            return str(device.serial_number)
        except self._library.errors:
            return ""  # it does not say: another camera, of no concern

    def _stamp_ns(self, buffer: Any) -> int | None:
        try:
            return int(buffer.module.timestamp_ns)
        except self._library.errors:
            return None

    @contextmanager
    def _talking(self, not_done: str) -> Iterator[None]:
        try:
            yield
        except self._library.errors as error:
            raise errors.gone(self.name, str(error), not_done) from error


def _is_same(held: str | float, value: str | float) -> bool:
    if isinstance(held, str) or isinstance(value, str):
        return held == value
    return math.isclose(held, value, rel_tol=_SAME, abs_tol=1e-6)
