"""Stanford Research SR830 and SR810 lock-in amplifiers as detectors of chopped light."""

from __future__ import annotations

import cmath
import math
from enum import Enum, auto

from drivers.clock import Clock
from drivers.same_device import same_device
from drivers.stanford_sr830.lock_in import LEAST_SENSITIVE, Condition, Settings, Sr830LockIn
from drivers.wire.link import Link
from goniometer.errors import DeviceFaultError, LimitError, ReplyError, SaturatedError

_SATURATED = Condition.INPUT_OVERLOAD | Condition.FILTER_OVERLOAD | Condition.OUTPUT_OVERLOAD
_DISTURBED = Condition.UNLOCKED | Condition.TIME_CONSTANT_CHANGED
_ROUNDING = 1 - 1e-9
_BRIGHT = 20.0  # of the noise: such light is seen in the lock-in's phase to 3 degrees


class _Doing(Enum):
    NOTHING = auto()
    SETTLING = auto()
    AVERAGING = auto()


class StanfordSr830:
    """A lock-in amplifier behind a photodiode, satisfying the engine's detector.

    A reading waits until the output filter has followed the light, and then averages, as complex numbers, one sample
    for each time constant of the exposure: samples closer together repeat each other, and the mean of magnitudes alone
    would be too large where there is little light. For the same reason a reading of little light is what is in phase
    with the plenty that was seen last; it may be below zero.

    Parameters
    ----------
    link : Link
        The serial port, without handshake.
    clock : Clock
        Counts settling and exposure.
    name : str
        The device's name in the rig file.
    responsivity_v_per_w : float
        Volts (rms) at the lock-in's input for each watt on the photodiode.
    noise_w : float
        Standard deviation of the noise of one sample, in W; light of twenty times as much tells the phase.
    settings : Settings
        What the lock-in is given, and must keep.
    raises_sensitivity : bool
        Whether a reading that overloads the output is begun again at the next larger full scale.

    Attributes
    ----------
    reference_hz : float
        Reference frequency at the last sample.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        *,
        name: str,
        responsivity_v_per_w: float,
        noise_w: float,
        settings: Settings,
        raises_sensitivity: bool = False,
    ) -> None:
        self.name = name
        self.reference_hz = 0.0
        self._link, self._clock = link, clock
        self._lock_in = Sr830LockIn(link, name=name)
        self._responsivity_v_per_w, self._raises_sensitivity = responsivity_v_per_w, raises_sensitivity
        self._settings, self._bright_v = settings, _BRIGHT * noise_w * responsivity_v_per_w
        self._light_v = complex(0.0)
        self.identity = ""
        self._doing = _Doing.NOTHING
        self._exposure_s = self._begun_s = self._next_s = 0.0
        self._samples_v: list[complex] = []
        self._trouble, self._has_settled_again = Condition(0), False
        link.on_reopen(self._forget)

    def connect(self) -> tuple[str, ...]:
        """Check that an SR830 or SR810 answers on this port; give it its settings.

        Returns
        -------
        tuple of str
            Overloads and losses of the reference that the lock-in remembers from earlier use, and the settings that it
            had and that were changed.

        Raises
        ------
        DeviceFaultError
            When it is another lock-in than the last time.
        """
        self._lock_in.begin()
        self.identity = same_device(self.name, self.identity, self._lock_in.identity())
        left_over = self._lock_in.condition() & (_SATURATED | Condition.UNLOCKED)
        changed = [f"{setting}, which was changed" for setting in self._lock_in.set(self._settings)]
        if changed:
            self._light_v = complex(0.0)  # one that was reset may have another phase
        return (*_words(left_over), *changed)

    def start_reading(self, exposure_s: float) -> None:
        """Begin a reading, whose samples will be taken over `exposure_s`, once the output filter has settled.

        Raises
        ------
        LimitError
            When the exposure is no positive number; nothing is sent.
        DeviceFaultError
            When its settings are no longer those that it was given.
        """
        if not 0 < exposure_s < math.inf:
            raise LimitError(
                self.name,
                f"an exposure of {exposure_s:g} s is not a positive number of seconds",
                not_done="the reading was not begun and nothing was sent",
                to_do="change exposure_s in the recipe",
            )
        self._exposure_s = exposure_s
        self._settle()

    def is_exposing(self) -> bool:
        """Whether light is still collected, which is as long as the reading is taken."""
        return self.is_reading()

    def is_reading(self) -> bool:
        """Whether the reading is still being taken; raises ReplyTimeoutError when the lock-in does not answer."""
        if self._doing is _Doing.NOTHING:
            return False
        if self._clock.now() < self._next_s:
            return True
        if self._doing is _Doing.SETTLING:
            self._begin_averaging()
        elif self._next_s - self._begun_s < self._exposure_s * _ROUNDING:
            self._take_sample()
        else:
            return self._finish()
        return True

    def power_w(self) -> float:
        """The finished reading in watts.

        Raises
        ------
        DeviceFaultError
            When the lock-in was saturated, lost its reference or had its time constant changed during the reading.
        ReplyError
            When no reading has been finished.
        """
        if self._doing is not _Doing.NOTHING or not self._samples_v:
            raise ReplyError(
                self.name,
                "there is no finished reading",
                not_done="no power was returned",
                to_do="begin a reading, and ask for its power when it has ended",
            )
        if self._trouble:
            raise self._spoilt()
        return self._signed_v() / self._responsivity_v_per_w

    def reconnect(self) -> None:
        """Open the port afresh, once; a reading that was being taken is given up. Raises NotConnectedError."""
        self._link.reconnect()

    def close(self) -> None:
        """Close the port."""
        self._link.close()

    def _settle(self) -> None:
        self._forget()
        begun_s = self._clock.now()
        # what happened before this reading is no fault of it, but the filter may still hold an overload
        settlings = 2 if self._lock_in.condition() & _SATURATED else 1
        if others := (held := self._lock_in.settings()).others(self._settings):
            raise DeviceFaultError(
                self.name,
                f"the lock-in was reset, or set otherwise at its front panel: {', '.join(others)}; it was given "
                f"{self._settings}",
                not_done="the reading was not begun",
                to_do="leave the front panel alone during a scan, check its power supply, and run the recipe again",
            )
        self._next_s = begun_s + settlings * held.settling_s
        self._doing = _Doing.SETTLING

    def _begin_averaging(self) -> None:
        condition = self._lock_in.condition()
        if condition & _SATURATED and not self._has_settled_again:
            # at some time since, perhaps just now
            self._has_settled_again = True
            self._next_s = self._clock.now() + self._settings.settling_s
            return
        self._trouble = condition & (_DISTURBED | _SATURATED)
        self._begun_s = self._next_s = self._clock.now()
        self._doing = _Doing.AVERAGING

    def _take_sample(self) -> None:
        sample = self._lock_in.sample()
        self._samples_v.append(cmath.rect(sample.magnitude_v, math.radians(sample.phase_deg)))
        self.reference_hz = sample.reference_hz
        end_s = self._begun_s + self._exposure_s
        self._next_s = max(min(self._next_s + self._settings.time_constant_s, end_s), self._clock.now())

    def _finish(self) -> bool:
        """Judge the reading; True when it was begun again."""
        self._trouble |= self._lock_in.condition() & (_SATURATED | _DISTURBED)
        if Condition.OUTPUT_OVERLOAD in self._trouble and self._raises_sensitivity:
            sensitivity = self._lock_in.sensitivity()
            if sensitivity < LEAST_SENSITIVE:
                self._lock_in.set_sensitivity(sensitivity + 1)
                self._settle()
                return True
        self._doing = _Doing.NOTHING
        return False

    def _signed_v(self) -> float:
        mean_v = sum(self._samples_v) / len(self._samples_v)
        if abs(mean_v) >= self._bright_v:
            self._light_v = mean_v
        if self._light_v in (0.0, mean_v):
            return abs(mean_v)
        return (mean_v * self._light_v.conjugate()).real / abs(self._light_v)

    def _forget(self) -> None:
        self._doing, self._samples_v, self._trouble = _Doing.NOTHING, [], Condition(0)
        self._has_settled_again = False

    def _spoilt(self) -> DeviceFaultError:
        saturated = "the detector was saturated: " if self._trouble & _SATURATED else ""
        kind = SaturatedError if saturated and not self._trouble & _DISTURBED else DeviceFaultError
        return kind(
            self.name,
            f"{saturated}the lock-in reports {' and '.join(_words(self._trouble))} during the reading",
            not_done="the reading was thrown away",
            to_do="when it was overloaded weaken the beam or choose a larger full scale; when it was unlocked look at "
            "the chopper and its cable; leave the front panel alone during a scan",
        )


def _words(condition: Condition) -> list[str]:
    return [str(flag.name).lower().replace("_", " ") for flag in condition]
