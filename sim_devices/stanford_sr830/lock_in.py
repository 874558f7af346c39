"""What an SR830 makes of the light: its reference, its phase, its filter, and the overloads on the way."""

from __future__ import annotations

import math
from enum import IntFlag
from typing import NamedTuple

from sim_devices.light import Light
from sim_devices.stanford_sr830.low_pass import LowPass
from sim_devices.stanford_sr830.settings import NOISE_EXPOSURES, SENSITIVITIES_V, TIME_CONSTANTS_S, wrapped_deg

_LARGEST_INPUT_V = 1.0
# a display goes so far beyond full scale
_FULL_SCALES = 1.09
_LOCK_PERIODS = 5
_LONGEST_EXPOSURE_S = 1.0
# where the detection frequency changes its range
_RANGE_HZ = 200.0


class Event(IntFlag):
    """What the lock-in status byte remembers; its other bits are never set here."""

    INPUT_OVERLOAD = 1
    OUTPUT_OVERLOAD = 4
    UNLOCKED = 8
    RANGE_CHANGE = 16


class Outputs(NamedTuple):
    """What is measured at one time: volts, degrees and hertz."""

    x: float
    y: float
    r: float
    theta: float
    frequency_hz: float


class LockIn:
    """A lock-in amplifier whose detector looks at a chopped light.

    Without a reference from the chopper there is nothing to see, and what the outputs are is not known: here they fall
    to 0. A new phase acts at once. The noise of the detector, averaged as long as the filter does, is drawn anew after
    that time.

    Parameters
    ----------
    light : Light
        What reaches the detector while the chopper is open.
    settings : dict of str to float
        The device's settings, by their commands; whoever changes one first calls `watch`, and tells of some.
    volts_per_watt : float
        Rms voltage at the fundamental of the chopped light.
    phase_deg : float
        Of the signal against the reference.
    chopper_hz : float
        Frequency of the chopper; 0 when it stands.
    """

    def __init__(
        self, light: Light, settings: dict[str, float], volts_per_watt: float, phase_deg: float, chopper_hz: float
    ) -> None:
        self._light, self._settings = light, settings
        self.volts_per_watt, self._phase_deg, self._chopper_hz = volts_per_watt, phase_deg, chopper_hz
        self._locked_s = -math.inf
        self._noise_v, self._noise_end_s = 0.0, -math.inf
        self._filter = LowPass(self._signal_v, *self._stages())
        self._range = self._frequency_hz(0.0) >= _RANGE_HZ
        self.events = Event(0)

    def watch(self, now_s: float) -> None:
        """Let everything happen that has happened by now, with the settings as they are."""
        self._filter.output(now_s)
        if self._filter.input_peak > _LARGEST_INPUT_V:
            self.events |= Event.INPUT_OVERLOAD
        if self._filter.output_peak > _FULL_SCALES * self.full_scale_v:
            self.events |= Event.OUTPUT_OVERLOAD
        self._filter.input_peak = self._filter.output_peak = 0.0
        if not self._is_locked(now_s):
            self.events |= Event.UNLOCKED

    def filter_changed(self) -> None:
        """Take the time constant and the slope that are set now."""
        self._filter.set(*self._stages())
        self._noise_end_s = -math.inf

    def reference_changed(self, now_s: float) -> None:
        """Take the reference that is set now; an external one is locked to after some periods."""
        if self._settings["FMOD"] == 0:
            period_s = 1 / self._chopper_hz if self._chopper_hz else math.inf
            self._locked_s = now_s + _LOCK_PERIODS * period_s
            self.events |= Event.UNLOCKED
        else:
            self._locked_s = -math.inf
        self.frequency_changed()

    def frequency_changed(self) -> None:
        """Take the frequency and the harmonic that are set now."""
        frequency_hz = self._settings["HARM"] * self._reference_hz
        if frequency_hz and (frequency_hz >= _RANGE_HZ) != self._range:
            self._range = not self._range
            self.events |= Event.RANGE_CHANGE

    def set_chopper(self, frequency_hz: float, now_s: float) -> None:
        """Let the chopper run at another frequency, or stand at 0."""
        self.watch(now_s)
        self._chopper_hz = frequency_hz
        self.reference_changed(now_s)

    @property
    def full_scale_v(self) -> float:
        """The sensitivity that is set."""
        return SENSITIVITIES_V[int(self._settings["SENS"])]

    def outputs(self, now_s: float) -> Outputs:
        """All outputs at one time; voltages end a little above full scale."""
        amplitude_v = self._filter.output(now_s) + self._noise(now_s)
        angle_rad = math.radians(self._phase_deg - self._settings["PHAS"])
        x, y = amplitude_v * math.cos(angle_rad), amplitude_v * math.sin(angle_rad)
        limit_v = _FULL_SCALES * self.full_scale_v
        return Outputs(
            min(max(x, -limit_v), limit_v),
            min(max(y, -limit_v), limit_v),
            min(abs(amplitude_v), limit_v),
            wrapped_deg(math.degrees(math.atan2(y, x))) if amplitude_v else 0.0,
            self._frequency_hz(now_s),
        )

    def settling_s(self) -> float:
        """A time after which the output has settled to better than 99 %."""
        return 10 * TIME_CONSTANTS_S[int(self._settings["OFLT"])]

    def _stages(self) -> tuple[float, int]:
        return TIME_CONSTANTS_S[int(self._settings["OFLT"])], int(self._settings["OFSL"]) + 1

    @property
    def _reference_hz(self) -> float:
        return self._settings["FREQ"] if self._settings["FMOD"] else self._chopper_hz

    def _is_locked(self, now_s: float) -> bool:
        return now_s >= self._locked_s

    def _frequency_hz(self, now_s: float) -> float:
        return self._reference_hz if self._is_locked(now_s) else 0.0

    def _signal_v(self, time_s: float) -> float:
        if not self._sees_light(time_s):
            return 0.0
        # a square wave has odd harmonics only, each weaker as its number
        return self.volts_per_watt / self._settings["HARM"] * self._light.power_w(time_s)

    def _sees_light(self, time_s: float) -> bool:
        """Whether the detector at input A is detected at the frequency of its chopper."""
        settings = self._settings
        return settings["FMOD"] == 0 and settings["ISRC"] < 2 and settings["HARM"] % 2 == 1 and self._is_locked(time_s)

    def _noise(self, now_s: float) -> float:
        if not self._sees_light(now_s):
            return 0.0
        if now_s >= self._noise_end_s:
            slope = int(self._settings["OFSL"])
            duration_s = NOISE_EXPOSURES[slope] * TIME_CONSTANTS_S[int(self._settings["OFLT"])]
            exposure_s = min(duration_s, _LONGEST_EXPOSURE_S)
            begin_s = now_s - exposure_s
            clear_w = self._light.power_w(begin_s + exposure_s / 2)
            noise_w = self._light.measure_w(begin_s, exposure_s) - clear_w
            # white noise falls with the root of the time
            self._noise_v = self.volts_per_watt * noise_w * math.sqrt(exposure_s / duration_s)
            self._noise_end_s = now_s + duration_s
        return self._noise_v
