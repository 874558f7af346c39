"""What an SR830 makes of the light: its reference, its phase, its filter, and the overloads on the way."""

from __future__ import annotations

import cmath
import math
from enum import IntFlag
from typing import NamedTuple

from sim_devices.light import ChoppedLight
from sim_devices.stanford_sr830.low_pass import LowPass
from sim_devices.stanford_sr830.settings import NOISE_EXPOSURES, SENSITIVITIES_V, TIME_CONSTANTS_S, wrapped_deg

# the peak of 1 V rms
_LARGEST_PEAK_V = math.sqrt(2)
# the swing of a square wave over the rms of its fundamental
_SWING = math.pi / math.sqrt(2)
# a display goes so far beyond full scale
_FULL_SCALES = 1.09
_LOCK_PERIODS = 5
_AC = 0
_LONGEST_EXPOSURE_S = 1.0
_SAMPLE_S = 0.003
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

    What the detector tells while the chopper is closed, such as its dark current, is there while it is open too, and
    is not detected: only the swing between the two is. Of a detector whose noise has the one-sided density e, in
    W/sqrt(Hz), X and Y have each the noise pi/sqrt(2) `volts_per_watt` e sqrt(B), with the filter's noise bandwidth B,
    whatever the chopper does to the light; it is averaged as long as the filter does, and drawn anew after that time.

    Without a reference from the chopper there is nothing to see, and what the outputs are is not known: here they fall
    to 0. A new phase acts at once.

    Parameters
    ----------
    light : ChoppedLight
        What the detector tells.
    settings : dict of str to float
        The device's settings, by their commands; whoever changes one first calls `watch`, and tells of some.
    volts_per_watt : float
        Rms voltage at the fundamental of the chopped light, for each watt while the chopper is open.
    phase_deg : float
        Of the signal against the reference.
    chopper_hz : float
        Frequency of the chopper; 0 when it stands.
    """

    def __init__(
        self,
        light: ChoppedLight,
        settings: dict[str, float],
        volts_per_watt: float,
        phase_deg: float,
        chopper_hz: float,
    ) -> None:
        self._light, self._settings = light, settings
        self._volts_per_watt, self._phase_deg, self._chopper_hz = volts_per_watt, phase_deg, chopper_hz
        self._locked_s = -math.inf
        self._noise_v, self._noise_end_s = 0j, -math.inf
        self._watched_s, self._input_peak_v = 0.0, 0.0
        self._filter = LowPass(self._signal_v, *self._stages())
        self._range = self._frequency_hz(0.0) >= _RANGE_HZ
        self.events = Event(0)

    def watch(self, now_s: float) -> None:
        """Let everything happen that has happened by now, with the settings as they are."""
        self._filter.output(now_s)
        if self._input_peak_v > _LARGEST_PEAK_V:
            self.events |= Event.INPUT_OVERLOAD
        if self._filter.output_peak > _FULL_SCALES * self.full_scale_v:
            self.events |= Event.OUTPUT_OVERLOAD
        self._filter.output_peak = self._input_peak_v = 0.0
        self._watched_s = now_s
        if not self._is_locked(now_s):
            self.events |= Event.UNLOCKED

    def restart(self, now_s: float) -> None:
        """Forget what happened, and lock to the reference again."""
        self.watch(now_s)
        self.events = Event(0)
        self.filter_changed()
        self.reference_changed(now_s)

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
        phase_rad = math.radians(self._phase_deg - self._settings["PHAS"])
        found_v = cmath.rect(self._filter.output(now_s), phase_rad) + self._noise(now_s)
        limit_v = _FULL_SCALES * self.full_scale_v
        return Outputs(
            min(max(found_v.real, -limit_v), limit_v),
            min(max(found_v.imag, -limit_v), limit_v),
            min(abs(found_v), limit_v),
            wrapped_deg(math.degrees(cmath.phase(found_v))) if found_v else 0.0,
            self._frequency_hz(now_s),
        )

    def level_v(self, now_s: float) -> float:
        """Mean voltage of the detector before the lock-in."""
        mean_w = (self._light.open_w(now_s, _SAMPLE_S) + self._light.closed_w(now_s, _SAMPLE_S)) / 2
        return self._volts_per_watt * _SWING * mean_w

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

    def _signal_v(self, start_s: float, duration_s: float) -> float:
        """What is detected of a stretch of light; what overloads the input is noted, and cut off."""
        settings = self._settings
        if not self._has_detector:
            return 0.0
        open_w, closed_w = self._light.open_w(start_s, duration_s), self._light.closed_w(start_s, duration_s)
        # between saturated and saturated there is no swing
        swing_w = open_w - closed_w if closed_w < math.inf else 0.0
        # through a capacitor a square wave swings about its middle; a detector at its limit is too much for any input
        peak_w = swing_w / 2 if settings["ICPL"] == _AC and open_w < math.inf else open_w
        peak_v = _SWING * self._volts_per_watt * peak_w
        if start_s + duration_s > self._watched_s:
            self._input_peak_v = max(self._input_peak_v, peak_v)
        is_synchronous = settings["FMOD"] == 0 and settings["HARM"] % 2 == 1 and self._is_locked(start_s)
        if not is_synchronous:
            return 0.0
        # a square wave has odd harmonics only, each weaker as its number
        return min(self._volts_per_watt * swing_w, 2 * _LARGEST_PEAK_V / _SWING) / settings["HARM"]

    @property
    def _has_detector(self) -> bool:
        """Whether the detector's input, A, is looked at."""
        return self._settings["ISRC"] < 2

    def _noise(self, now_s: float) -> complex:
        """Noise of X and, as the imaginary part, of Y."""
        if not (self._has_detector and self._is_locked(now_s)):
            return 0j
        if now_s >= self._noise_end_s:
            slope = int(self._settings["OFSL"])
            duration_s = NOISE_EXPOSURES[slope] * TIME_CONSTANTS_S[int(self._settings["OFLT"])]
            exposure_s = min(duration_s, _LONGEST_EXPOSURE_S)
            # white noise falls with the root of the time
            volts = self._volts_per_watt * _SWING * math.sqrt(exposure_s / duration_s)
            x_w, y_w = (self._light.noise_w(now_s - exposure_s, exposure_s) for _ in range(2))
            self._noise_v = volts * complex(x_w, y_w)
            self._noise_end_s = now_s + duration_s
        return self._noise_v
