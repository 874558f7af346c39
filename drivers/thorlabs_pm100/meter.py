"""Thorlabs power meters of the PM100 family: SCPI lines, one reading an average over many samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from drivers.clock import Clock, Deadline
from drivers.same_device import same_device
from drivers.thorlabs_pm100 import errors
from drivers.thorlabs_pm100.errors import parse_error
from drivers.wire.line_dialogue import LineDialogue
from drivers.wire.link import Link
from drivers.wire.reply_text import number, unusable, whole_number
from goniometer.errors import LimitError, ReplyError, ReplyTimeoutError

T = TypeVar("T")

_OVER_RANGE = 9.9e37
_READING, _AGAIN = "MEAS:POW?", "FETC?"
_WATTS = "SENS:POW:UNIT W"
_ATTENUATION = "SENS:CORR?"
_SAME_DB = 0.005  # a thousandth of the power
_MOST_ERRORS = 32
_MOST_SAMPLES = 3000
_FACTORY_AVERAGE = 1
_MOST_ATTEMPTS = 3
_ROUNDING = 1 - 1e-9


class ThorlabsPm100:
    """A power meter.

    Parameters
    ----------
    link : Link
        Serial or TCP.
    clock : Clock
        Counts the deadline of a reading.
    name : str
        The device's name in the rig file.
    sample_s : float
        Duration of one sample; an exposure is this times the averaging count.
    attenuation_db : float
        Of the attenuator before its sensor for which the meter corrects its readings; 0 for none.

    Attributes
    ----------
    actual_exposure_s : float
        Exposure of the reading begun last: the whole number of samples nearest to what was asked for.
    """

    def __init__(self, link: Link, clock: Clock, *, name: str, sample_s: float, attenuation_db: float = 0.0) -> None:
        self.name, self.sample_s, self.attenuation_db = name, sample_s, attenuation_db
        self.actual_exposure_s = 0.0
        self._link = link
        self._clock = clock
        self._dialogue = LineDialogue(
            link,
            identity_question="*IDN?",
            identity="THORLABS",
            command_end=b"\n",
            answer_end=b"\n",
            end_cut_command=lambda: self._dialogue.tell(_WATTS),
        )
        self.identity = ""
        self._averaged: int | None = None
        self._attempts = 0
        self._deadline = Deadline(clock, 0.0)
        self._reading_w: float | None = None
        self._exposed_s = 0.0
        self._wavelength_nm: float | None = None
        link.on_reopen(self._forget)

    def connect(self) -> tuple[str, ...]:
        """Check that a Thorlabs meter answers, empty its error queue, set watts and automatic range.

        When it is called again, it must be the same meter, and is told the wavelength again: it may have been switched
        off meanwhile. The averaging count is told with the next reading.

        Returns
        -------
        tuple of str
            The errors that were still in the queue from earlier use, oldest first.

        Raises
        ------
        DeviceFaultError
            When the meter refuses what it is told, corrects its readings for another attenuator, or is another one than
            the last time.
        """
        self._dialogue.begin()
        self._averaged = None
        self.identity = same_device(self.name, self.identity, self._dialogue.identity())
        earlier_errors = self._pop_errors()
        self._dialogue.tell(_WATTS)
        self._dialogue.tell("SENS:POW:RANG:AUTO 1")
        refused = self._pop_errors()
        if refused:
            raise errors.set_up_refused(self.name, refused)
        held_db = self._query(_ATTENUATION, number)
        if abs(held_db - self.attenuation_db) > _SAME_DB:
            raise errors.other_attenuation(self.name, held_db, self.attenuation_db)
        if self._wavelength_nm is not None:
            self.set_wavelength_nm(self._wavelength_nm)
        return tuple(earlier_errors)

    def set_wavelength_nm(self, wavelength_nm: float) -> None:
        """Set the wavelength at which the sensor's calibration is taken.

        Raises
        ------
        LimitError
            When the sensor is not calibrated there; the wavelength is not sent.
        DeviceFaultError
            When the meter holds another wavelength afterwards.
        """
        low_nm, high_nm = self._query("SENS:CORR:WAV? MIN", number), self._query("SENS:CORR:WAV? MAX", number)
        if not low_nm <= wavelength_nm <= high_nm:
            raise LimitError(
                self.name,
                f"the sensor is calibrated from {low_nm:g} to {high_nm:g} nm, not at {wavelength_nm:g} nm",
                not_done="the wavelength was not changed",
                to_do="change wavelength_nm in the recipe, or use another sensor",
            )
        self._dialogue.tell(f"SENS:CORR:WAV {wavelength_nm:g}")
        self._require_wavelength(wavelength_nm)
        self._wavelength_nm = wavelength_nm

    def start_reading(self, exposure_s: float) -> None:
        """Begin a reading averaged over the whole number of samples, one at least, nearest to `exposure_s`.

        Raises
        ------
        LimitError
            When the meter cannot average over so long an exposure; nothing is sent.
        """
        if not 0 < exposure_s / self.sample_s < _MOST_SAMPLES + 0.5:
            raise LimitError(
                self.name,
                f"an exposure of {exposure_s:g} s is not between 0 and {_MOST_SAMPLES * self.sample_s:g} s, the "
                f"{_MOST_SAMPLES} samples of {self.sample_s:g} s that the meter can average",
                not_done="the reading was not begun and nothing was sent",
                to_do="change exposure_s in the recipe, and take more readings instead of a longer one",
            )
        count = max(1, round(exposure_s / self.sample_s))
        if count != self._averaged:
            self._dialogue.tell(f"SENS:AVER {count}")
            self._averaged = count
        self.actual_exposure_s = count * self.sample_s
        self._attempts = 0
        self._begin_reading()

    def is_exposing(self) -> bool:
        """Whether light is still collected: the exposure goes on, or no answer has come that is still awaited."""
        if self._reading_w is not None or self._clock.now() < self._exposed_s:
            return self._reading_w is None
        return not self._dialogue.is_answered() and not self._deadline.has_passed()

    def is_reading(self) -> bool:
        """Whether the reading is still to come; one whose answer was lost, or is in doubt, is taken again, twice.

        Raises
        ------
        ReplyTimeoutError
            When it has not come after twice the exposure and 2 s, for the third time.
        ReplyError
            When what has come is not a number, or not what the meter tells when it is asked again.
        DeviceFaultError
            When the meter has lost its settings.
        """
        if self._reading_w is not None:
            return False
        try:
            reading_w = self._dialogue.poll(lambda answer: number(self.name, _READING, answer))
            if reading_w is None:
                if self._deadline.has_passed():
                    raise errors.overdue(self.name, self._link.port, self.actual_exposure_s)
                return True
            self._confirm(reading_w)
        except (ReplyTimeoutError, ReplyError):
            if self._attempts == _MOST_ATTEMPTS:
                raise
            self._begin_reading()
            return True
        self._reading_w = reading_w
        return False

    def power_w(self) -> float:
        """The finished reading in watts.

        Raises
        ------
        DeviceFaultError
            When the detector was saturated.
        ReplyError
            When no reading has been finished.
        """
        if self._reading_w is None:
            raise ReplyError(
                self.name,
                "there is no finished reading",
                not_done="no power was returned",
                to_do="begin a reading, and ask for its power when it has ended",
            )
        if abs(self._reading_w) >= _OVER_RANGE:
            raise errors.saturated(self.name, self._reading_w)
        return self._reading_w

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError. The reading that was being taken is lost."""
        self._link.reconnect()

    def close(self) -> None:
        """Close the port."""
        self._link.close()

    def _forget(self) -> None:
        self._averaged = self._reading_w = None

    def _begin_reading(self) -> None:
        self._attempts += 1
        self._reading_w = None
        self._exposed_s = self._clock.now() + self.actual_exposure_s * _ROUNDING
        self._link.until_answered(lambda: self._dialogue.ask(_READING))
        self._deadline = Deadline(self._clock, 2 * self.actual_exposure_s + 2.0)

    def _confirm(self, reading_w: float) -> None:
        """Ask again for the same reading: nothing else shows a wrong digit, or an answer to another question.

        The question behind it has another kind of answer, so that one answer too many does not stay unnoticed.
        """
        again_w = self._query(_AGAIN, number)
        held = self._query("SENS:AVER?", whole_number)
        if held != self._averaged:
            raise errors.settings_lost(self.name, "SENS:AVER?", held, f"the averaging count {self._averaged}")
        if self._averaged == _FACTORY_AVERAGE and self._wavelength_nm is not None:
            self._require_wavelength(self._wavelength_nm)
        if again_w != reading_w:
            raise unusable(self.name, _READING, f"{reading_w:g}", f"the {again_w:g} of {_AGAIN} behind it")

    def _require_wavelength(self, wavelength_nm: float) -> None:
        held_nm = self._query("SENS:CORR:WAV?", number)
        if abs(held_nm - wavelength_nm) > 0.5:  # some meters hold whole nanometres
            raise errors.settings_lost(self.name, "SENS:CORR:WAV?", held_nm, f"the {wavelength_nm:g} nm")

    def _pop_errors(self) -> list[str]:
        found: list[str] = []
        while (error := self._dialogue.query("SYST:ERR?", lambda line: parse_error(self.name, line)))[0] != 0:
            found.append(f"{error[0]} {error[1]}")
            if len(found) > _MOST_ERRORS:
                raise unusable(self.name, "SYST:ERR?", found[-1], f"the end of a queue of {_MOST_ERRORS} errors")
        return found

    def _query(self, question: str, read: Callable[[str, str, str], T]) -> T:
        return self._dialogue.query(question, lambda answer: read(self.name, question, answer), safe_to_repeat=True)
