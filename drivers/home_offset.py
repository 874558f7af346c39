"""The home offset that other software may have left in a controller: its zero, and so every angle, hangs on it."""

from __future__ import annotations

from goniometer.errors import DeviceFaultError

_ALIKE_DEG = 1e-3


class HomeOffset:
    """What a stage's home offset should be; it is never written, for a maker or a laboratory may have chosen it.

    Parameters
    ----------
    name : str
        The axis' name in the rig file.
    expected_deg : float or None
        As the rig file says; None takes the first that is found, and notes it unless it is 0.
    """

    def __init__(self, name: str, expected_deg: float | None) -> None:
        self._name, self._expected_deg = name, expected_deg

    def check(self, found_deg: float) -> tuple[str, ...]:
        """Return what a person should know of the offset that was found; raises DeviceFaultError for another one."""
        if self._expected_deg is None:
            self._expected_deg = found_deg
            return self._note(found_deg) if abs(found_deg) > _ALIKE_DEG else ()
        if abs(found_deg - self._expected_deg) > _ALIKE_DEG:
            raise DeviceFaultError(
                self._name,
                f"its home offset is {found_deg:.4g} degrees, and should be {self._expected_deg:.4g}: other software "
                "has changed it, or the device has forgotten it",
                not_done="nothing was moved: every angle would be wrong by the difference",
                to_do="set the offset back with that software and home the stage; or write the offset that was found "
                "as home_offset_deg into the rig file, home the stage and find its zero_deg again",
            )
        return ()

    def _note(self, found_deg: float) -> tuple[str, ...]:
        return (
            f"{self._name} has a home offset of {found_deg:.4g} degrees, on which its zero hangs; with "
            f"home_offset_deg: {found_deg:.4g} in the rig file a change of it is noticed",
        )
