"""Whether it is the same device that answers after its link was lost: two of a make may have changed their cables."""

from __future__ import annotations

from goniometer.errors import DeviceFaultError


def same_device(name: str, before: str, now: str) -> str:
    """Return what a device says of itself now, with its serial number; raises DeviceFaultError when it is another.

    Parameters
    ----------
    name : str
        The device's name in the rig file, for the message.
    before, now : str
        What it said when it was connected first, empty if this is the first time, and what it says now.
    """
    if before and now != before:
        raise DeviceFaultError(
            name,
            f"another device answers since the link was lost: {now!r}, and before {before!r}",
            not_done="it was not used any more",
            to_do="look which cable leads where, and run the recipe again",
        )
    return now
