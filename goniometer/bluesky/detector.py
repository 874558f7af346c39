"""The detector as Bluesky triggers and reads it, in watts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from acquisition.protocols import Detector
from acquisition.timing import READING_POLL_S
from goniometer.bench_commands.measuring import whole_samples_s
from goniometer.bluesky.bench_thread import BenchThread
from goniometer.bluesky.device import BenchDevice, BenchTime, reading
from goniometer.bluesky.processes import Process
from goniometer.bluesky.status import Status
from goniometer.errors import ConfigurationError, GoniometerError
from goniometer.rig_devices.entry import DetectorEntry

if TYPE_CHECKING:
    from bluesky.protocols import Reading
    from event_model import DataKey


_DIGITS = 14
"""Digits after the decimal point that show a nanowatt with a precision of a hundred thousandth."""


class BlueskyDetector(BenchDevice):
    """Triggerable, Readable and Configurable, as `bluesky.protocols` has them.

    Parameters
    ----------
    detector : Detector
        The driver.
    entry : DetectorEntry
        What the rig file says of it.
    exposure_s : float
        Of each reading; `configure` changes it.
    wavelength_nm : float or None
        What the driver was told on connecting.
    """

    def __init__(
        self,
        detector: Detector,
        entry: DetectorEntry,
        source: str,
        thread: BenchThread,
        time: BenchTime,
        *,
        exposure_s: float,
        wavelength_nm: float | None,
    ) -> None:
        told = {} if wavelength_nm is None else {"wavelength": (float(wavelength_nm), "nm")}
        super().__init__("detector", source, thread, time, told)
        self._detector, self._entry = detector, entry
        self._taken: Reading[float] | None = None
        self.configure({"exposure_s": exposure_s})

    def configure(self, settings: Mapping[str, Any]) -> tuple[dict[str, Reading[Any]], dict[str, Reading[Any]]]:
        """Set the exposure, ``{"exposure_s": 0.3}``, to the whole samples that come nearest.

        Returns
        -------
        tuple of dict
            The configuration before and after.

        Raises
        ------
        ConfigurationError
            For any other setting, or an exposure that the detector does not have; nothing is changed.
        """
        if list(settings) != ["exposure_s"]:
            raise ConfigurationError([f"{self.name}: {dict(settings)} cannot be set; it has exposure_s alone."])
        if not settings["exposure_s"] > 0:
            raise ConfigurationError([f"{self.name}: an exposure of {settings['exposure_s']} s is none."])
        before = self.read_configuration()
        self._exposure_s = whole_samples_s(self._entry, settings["exposure_s"])
        self._set_up({"exposure": (self._exposure_s, "s")})
        return before, self.read_configuration()

    def trigger(self) -> Status:
        """Take a reading; fails when it does not come, or the detector was saturated."""
        return self._begin(f"reading of {self.name}", self._take())

    def read(self) -> dict[str, Reading[float]]:
        """The reading that was taken last, stamped with its beginning; raises GoniometerError before the first."""
        if self._taken is None:
            raise GoniometerError(f"{self.name}: nothing was read yet. Trigger it first, as the plans of Bluesky do.")
        return {self.name: self._taken}

    def describe(self) -> dict[str, DataKey]:
        """What `read` returns; Bluesky's tables show as many digits as `precision` says."""
        key = self._data_key(0.0, "W")
        key["precision"] = _DIGITS
        return {self.name: key}

    def _take(self) -> Process:
        self._taken = None
        unix_s = self._time.unix_s()
        self._detector.start_reading(self._exposure_s)
        yield READING_POLL_S
        while self._detector.is_reading():
            yield READING_POLL_S
        self._taken = reading(self._detector.power_w(), unix_s)
