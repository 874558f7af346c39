"""One reading of a camera as several exposures, so that dark and bright parts of a picture are both well lit."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.protocols import Camera
from drivers.camera.frame import Frame
from goniometer.errors import SaturatedError


class Exposures:
    """A camera that takes each reading in several exposures; satisfies the engine's detector.

    Parameters
    ----------
    camera : Camera
        What takes the pictures.
    ratios : sequence of float
        Each exposure over the reading's, from 1 downwards.

    Attributes
    ----------
    used_s : float
        For how long the picture that the power comes from was exposed: the longest one whose region is not saturated.
    """

    def __init__(self, camera: Camera, ratios: Sequence[float] = (1.0,)) -> None:
        self.name = camera.name
        self._camera, self._ratios = camera, tuple(ratios)
        self._exposure_s = self.used_s = 0.0
        self._frames: list[Frame] = []
        self._power_w: float | None = None
        self._saturated: SaturatedError | None = None

    def connect(self) -> tuple[str, ...]:
        """Check and set up the camera."""
        return self._camera.connect()

    def reconnect(self) -> None:
        """Open its port afresh; the reading under way is lost."""
        self._camera.reconnect()
        self._forget()

    def start_reading(self, exposure_s: float) -> None:
        """Begin a reading with its longest exposure; raises LimitError for one that cannot be."""
        self._forget()
        self._exposure_s = exposure_s
        self._camera.start_reading(exposure_s * self._ratios[0])

    def is_exposing(self) -> bool:
        """Whether the reading still needs the light; between two exposures it does."""
        if len(self._frames) + 1 < len(self._ratios):
            self._go_on()
            return True
        return not self._is_whole and self._camera.is_exposing()

    def is_reading(self) -> bool:
        """Whether the reading is still being taken; raises ReplyTimeoutError when it does not come."""
        self._go_on()
        return not self._is_whole

    def power_w(self) -> float:
        """Mean over the region of the longest exposure that is not saturated there.

        Raises
        ------
        SaturatedError
            When the shortest one is.
        """
        if self._power_w is not None:
            return self._power_w
        if self._saturated is not None:
            raise self._saturated
        return self._camera.power_w()  # says that there is no finished reading

    def frames(self) -> tuple[Frame, ...]:
        """The pictures of the finished reading, the longest exposure first."""
        return tuple(self._frames)

    @property
    def _is_whole(self) -> bool:
        return len(self._frames) == len(self._ratios)

    def _go_on(self) -> None:
        """Take what has come, and begin what is next."""
        if self._is_whole or self._camera.is_reading():
            return
        self._frames.append(self._camera.frame())
        if self._power_w is None:
            try:
                self._power_w = self._camera.power_w()
                self.used_s = self._frames[-1].exposure_s * self._frames[-1].averaged
            except SaturatedError as error:
                self._saturated = error
        if not self._is_whole:
            self._camera.start_reading(self._exposure_s * self._ratios[len(self._frames)])

    def _forget(self) -> None:
        self._frames, self._power_w, self._saturated = [], None, None
