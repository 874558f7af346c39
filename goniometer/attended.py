"""Who has a say in a scan while it runs: signals, a person at the keyboard or a program, a judge of readings."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition.control import ScanControl
from acquisition.suspend import SuspendWhen
from goniometer.signals import Interruption


@dataclass(frozen=True)
class Attended:
    """Who has a say in a scan while it runs.

    Parameters
    ----------
    interruption : Interruption
        Signals.
    control : ScanControl
        What a person or a program asks for.
    suspend_when : callable or None
        Judges each reading before it is stored.
    watchdog_s : float
        How long the scan's thread may hang, in real seconds.
    """

    interruption: Interruption
    control: ScanControl
    suspend_when: SuspendWhen | None
    watchdog_s: float

    def check(self) -> None:
        """Raise ScanInterrupted when the scan was asked to end, by whomever."""
        self.interruption.check()
        self.control.check()
