"""How long the bench takes from one place to another."""

from __future__ import annotations

from acquisition.settings_tour import change_s
from acquisition.steps import Target
from acquisition.timing import CONFIRM_S, FIRST_SLOT, BenchTiming


class Moving:
    """How long the bench takes from one place to another, until a reading can begin.

    Parameters
    ----------
    timing : BenchTiming
        Speeds of the rig. But for axes that could touch and so wait for each other, only the differences of angles
        count, and the same ones come again and again.
    """

    def __init__(self, timing: BenchTiming) -> None:
        self._timing = timing
        self._known_s: dict[tuple[float | None, ...], float] = {}

    def __call__(self, here: Target, there: Target) -> float:
        """Duration of the way, settling and questions included."""
        incidence_deg, azimuth_deg = there.incidence_deg - here.incidence_deg, there.azimuth_deg - here.azimuth_deg
        exit_azimuth_deg = round(there.exit_azimuth_deg - here.exit_azimuth_deg, 9)
        if self._timing.zones and (incidence_deg or azimuth_deg or exit_azimuth_deg):
            return _moving_s(here, there, self._timing)
        exit_deg = round(there.exit_deg - here.exit_deg, 9)
        slots = here.slot, there.slot, here.generator, there.generator, here.filter_slot, there.filter_slot
        key = (incidence_deg, exit_deg, azimuth_deg, exit_azimuth_deg, *slots)
        known_s = self._known_s.get(key)
        if known_s is None:
            known_s = self._known_s[key] = _moving_s(here, there, self._timing)
        return known_s


def _moving_s(here: Target, there: Target, timing: BenchTiming) -> float:
    here_deg, there_deg = here.axes_deg, there.axes_deg
    going = [axis for role, axis in timing.axes.items() if there_deg[role] != here_deg[role]]
    settles_s = [axis.settle_s for axis in going]
    starting_s = sum(timing.watching_s + axis.exchange_s for axis in going)
    moving_s = timing.axes_s(here_deg, there_deg) + starting_s + sum(axis.start_s for axis in going)
    turning_s, settling_s = change_s(timing, (here.slot, here.generator), (there.slot, there.generator))
    moving_s, settles_s = max(moving_s, turning_s and starting_s + turning_s), [*settles_s, settling_s]
    if timing.filter is not None and there.filter_slot is not None:
        begin = here.filter_slot or FIRST_SLOT
        if begin != there.filter_slot:
            moving_s = max(moving_s, timing.filter.move_s(begin, there.filter_slot))
            settles_s.append(timing.filter.settle_s)
    if going:
        moving_s -= CONFIRM_S
    return moving_s + max(settles_s, default=0.0)
