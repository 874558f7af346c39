"""How an axis may be moved, and which way it takes: limits, the approach from one side, the way round."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Travel:
    """How an axis may be moved, and when it has arrived; angles in degrees.

    Parameters
    ----------
    limits_deg : tuple of float
        Lowest and highest angle that the axis may be sent to.
    settle_s, tolerance_deg : float
        Time to come to rest, and how far from its target the axis may stop.
    zero_deg : float
        What the stage reads where the axis is at 0.
    backlash_deg : float
        Play of the gear. Every target is approached upwards: a move down, or a short one after it, goes so far below
        the target and comes back. 0 for a stage without play.
    wraps : bool
        Whether the stage may turn for ever, so that the axis takes the shorter way round.
    """

    limits_deg: tuple[float, float]
    settle_s: float
    tolerance_deg: float
    zero_deg: float = 0.0
    backlash_deg: float = 0.0
    wraps: bool = False

    @property
    def reachable_deg(self) -> tuple[float, float]:
        """The limits, less what the approach from below needs."""
        low_deg, high_deg = self.limits_deg
        return low_deg + (0.0 if self.wraps else self.backlash_deg), high_deg

    def way_deg(self, here_deg: float, target_deg: float, *, came_from_below: bool) -> list[float]:
        """The angles where a move begins, turns and ends; of an axis that wraps, with its whole turns.

        `came_from_below` says that the play is out already, so that a short move up needs no approach.
        """
        if self.wraps:
            target_deg = nearest_turn_deg(target_deg, here_deg)
        play_deg, up_deg = self.backlash_deg, target_deg - here_deg
        if play_deg and not (up_deg >= 0 and (came_from_below or up_deg > play_deg)):
            return [here_deg, target_deg - play_deg, target_deg]
        return [here_deg, target_deg]


def nearest_turn_deg(angle_deg: float, to_deg: float) -> float:
    """The angle that differs from `angle_deg` by whole turns and is nearest to `to_deg`."""
    return angle_deg + 360.0 * round((to_deg - angle_deg) / 360.0)
