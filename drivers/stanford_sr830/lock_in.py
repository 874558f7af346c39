"""What an SR830 can be asked and told, one line each."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Flag

from drivers.wire.line_dialogue import LineDialogue
from drivers.wire.link import Link
from drivers.wire.reply_text import number, unusable, whole_number

LEAST_SENSITIVE = 26
TIME_CONSTANTS_S = tuple(float(f"{digit}e{power}") for power in range(-5, 5) for digit in (1, 3))
"""10 us, 30 us, 100 us ... 30 ks."""

SLOPES_DB = (6, 12, 18, 24)
INPUTS = ("A", "A-B", "I with 1 MOhm", "I with 100 MOhm")
_HIGHEST_HARMONIC = 19_999
# Until all but 1e-4 of a step has passed, for each slope: exp(-n) (1 + n + n^2/2 ...) with as many terms as there are
# stages. To 99 % it takes 5 to 10, but then the light of the last slot would be seen in every reading.
_SETTLING_TIME_CONSTANTS = (9.3, 11.8, 14.0, 16.0)
_EXTERNAL, _INTERNAL = 0, 1
_ANSWERS_TO_SERIAL_PORT = "OUTX 0"
# magnitude and phase twice: its line has no checksum, and a digit that was garbled would be a digit
_SAMPLE = "SNAP? 3,4,9,3,4"
_OFFSET = "OEXP? 3"


@dataclass(frozen=True)
class Sample:
    """One simultaneous reading: magnitude in volts (rms), phase in degrees, reference frequency in hertz."""

    magnitude_v: float
    phase_deg: float
    reference_hz: float


@dataclass(frozen=True)
class Settings:
    """What readings hang on.

    Parameters
    ----------
    time_constant_s : float
        Of the low-pass filter behind the demodulator: one of `TIME_CONSTANTS_S`.
    slope_db : int
        Its slope, in dB an octave: one of `SLOPES_DB`.
    input : str
        Where the signal comes in: one of `INPUTS`.
    follows_chopper : bool
        Whether the reference is the external one.
    harmonic : int
        The multiple of the reference that is detected.
    offset_percent : float
        Of full scale, what is subtracted from the magnitude.
    """

    time_constant_s: float
    slope_db: int
    input: str = "A"
    follows_chopper: bool = True
    harmonic: int = 1
    offset_percent: float = 0.0

    def __str__(self) -> str:
        return ", ".join(self.commands.values())

    @property
    def commands(self) -> dict[str, str]:
        """What each of them is, in words, by the command that sets it."""
        reference = _EXTERNAL if self.follows_chopper else _INTERNAL
        return {
            f"OFLT {TIME_CONSTANTS_S.index(self.time_constant_s)}": f"time constant {self.time_constant_s:g} s",
            f"OFSL {SLOPES_DB.index(self.slope_db)}": f"slope {self.slope_db} dB",
            f"ISRC {INPUTS.index(self.input)}": f"input {self.input}",
            f"FMOD {reference}": f"{'external' if self.follows_chopper else 'internal'} reference",
            f"HARM {self.harmonic}": f"harmonic {self.harmonic}",
            f"OEXP 3,{self.offset_percent:g},0": f"offset of R {self.offset_percent:g} %",
        }

    def others(self, wanted: Settings) -> list[str]:
        """What is not as wanted, in words."""
        return [words for command, words in self.commands.items() if command not in wanted.commands]

    @property
    def settling_s(self) -> float:
        """How long the output takes to follow the light, to 1e-4 of a step."""
        return _SETTLING_TIME_CONSTANTS[SLOPES_DB.index(self.slope_db)] * self.time_constant_s


class Condition(Flag):
    """What has happened since the lock-in was last asked."""

    INPUT_OVERLOAD = 1
    FILTER_OVERLOAD = 2
    OUTPUT_OVERLOAD = 4
    UNLOCKED = 8
    RANGE_CHANGED = 16
    TIME_CONSTANT_CHANGED = 32
    TRIGGERED = 64


def parse_sample(device: str, answer: str) -> Sample:
    """Read an answer such as ``0.00103,12.5,317.2,0.00103,12.5``; raises ReplyError otherwise."""
    fields = [field.strip() for field in answer.split(",")]
    if len(fields) != 5 or fields[:2] != fields[3:]:
        raise unusable(device, _SAMPLE, answer, "three numbers and the first two again, with commas between")
    return Sample(*(number(device, _SAMPLE, field) for field in fields[:3]))


def parse_offset(device: str, answer: str) -> float:
    """Read the offset in an answer to ``OEXP? 3`` such as ``-12.5,0``, in percent; raises ReplyError otherwise."""
    fields = answer.split(",")
    if len(fields) != 2:
        raise unusable(device, _OFFSET, answer, "two numbers with a comma between")
    return number(device, _OFFSET, fields[0].strip())


def parse_condition(device: str, answer: str) -> Condition:
    """Read an answer to ``LIAS?``, a byte of flags; raises ReplyError otherwise."""
    flags = whole_number(device, "LIAS?", answer)
    if not 0 <= flags <= 0xFF:
        raise unusable(device, "LIAS?", answer, "a whole number from 0 to 255")
    return Condition(flags & 0x7F)


class Sr830LockIn:
    """A lock-in amplifier SR830 or SR810 on RS-232.

    Parameters
    ----------
    link : Link
        The serial port, without handshake.
    name : str
        The device's name in the rig file.
    """

    def __init__(self, link: Link, *, name: str) -> None:
        self._name = name
        self._dialogue = LineDialogue(
            link,
            identity_question="*IDN?",
            identity="STANFORD_RESEARCH_SYSTEMS,SR8",
            command_end=b"\r",
            answer_end=b"\r",
            end_cut_command=lambda: self._dialogue.tell(_ANSWERS_TO_SERIAL_PORT),
        )

    def begin(self) -> None:
        """Have the answers sent to this port, and the identity proven before the next question."""
        self._dialogue.begin()

    def identity(self) -> str:
        """What it says of itself, with its serial number."""
        return self._dialogue.identity()

    def settings(self) -> Settings:
        """Ask for the filter, the input, the reference, the harmonic and the offset."""
        return Settings(
            TIME_CONSTANTS_S[self._index("OFLT?", len(TIME_CONSTANTS_S) - 1)],
            SLOPES_DB[self._index("OFSL?", len(SLOPES_DB) - 1)],
            INPUTS[self._index("ISRC?", len(INPUTS) - 1)],
            self._index("FMOD?", 1) == _EXTERNAL,
            self._index("HARM?", _HIGHEST_HARMONIC),
            self._dialogue.query(_OFFSET, lambda answer: parse_offset(self._name, answer), safe_to_repeat=True),
        )

    def set(self, wanted: Settings) -> list[str]:
        """Set what differs and return what it was, in words; raises ReplyError when it holds something else then."""
        held = self.settings()
        changed = held.others(wanted)
        for command in wanted.commands:
            if command not in held.commands:
                self._dialogue.tell(command)
        if changed and (now := self.settings()).others(wanted):
            raise unusable(self._name, "OFLT? ... OEXP?", str(now), f"what was just set ({wanted})")
        return changed

    def sensitivity(self) -> int:
        """Ask for the index of the full scale, 0 (2 nV) to 26 (1 V)."""
        return self._index("SENS?", LEAST_SENSITIVE)

    def set_sensitivity(self, index: int) -> None:
        """Set the full scale; raises ReplyError when the lock-in holds another one afterwards."""
        self._dialogue.tell(f"SENS {index}")
        held = self.sensitivity()
        if held != index:
            raise unusable(self._name, "SENS?", str(held), f"the sensitivity {index} just set")

    def condition(self) -> Condition:
        """Ask what has happened since the last question; what was told is forgotten by the lock-in."""
        return self._dialogue.query("LIAS?", lambda answer: parse_condition(self._name, answer))

    def sample(self) -> Sample:
        """Ask for magnitude, phase and reference frequency of one moment."""
        return self._dialogue.query(_SAMPLE, lambda answer: parse_sample(self._name, answer), safe_to_repeat=True)

    def _index(self, question: str, largest: int) -> int:
        def read(answer: str) -> int:
            index = whole_number(self._name, question, answer)
            if not 0 <= index <= largest:
                raise unusable(self._name, question, answer, f"a whole number from 0 to {largest}")
            return index

        return self._dialogue.query(question, read, safe_to_repeat=True)
