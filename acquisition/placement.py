"""Brings the bench where a step wants it, and sees that it stays there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from acquisition.expand import Target
from acquisition.protocols import Analyzer, RotaryAxis
from acquisition.timing import POLL_S
from goniometer.errors import PositionError

if TYPE_CHECKING:
    from acquisition.engine import Bench

_ANALYZER = "analyzer"


class Placement:
    """Where the bench stands, as its devices say, and was left.

    Parameters
    ----------
    bench : Bench
        The devices.
    wait : callable
        Lets time pass; raises to end the scan.
    """

    def __init__(self, bench: Bench, wait: Callable[[float], None]) -> None:
        self._bench, self._wait = bench, wait
        self._left_deg: dict[str, float] = {}
        self._sent: set[str] = set()
        self._at: tuple[Target, tuple[float, ...]] | None = None

    def leave(self) -> None:
        """Take nothing for granted: `arrive` asks every device again where it stands."""
        self._at = None

    def arrive(self, target: Target) -> tuple[float, ...]:
        """Bring the bench to a target, unless it has arrived there and did not leave.

        Returns
        -------
        tuple of float
            The angles read back, in degrees: incidence, exit, azimuth.

        Raises
        ------
        PositionError
            When an axis was not where it was left, nothing being moved, or has not come to where it was sent.
        """
        if self._at is None or self._at[0] != target:
            self._at = None
            self._move(target)
            positions_deg = self._read_back(target)
            self.require_slot(target.slot)
            self._at = target, positions_deg
        return self._at[1]

    def require_still_there(self) -> dict[str, float]:
        """Where the axes are; raises PositionError when one is not where it was left.

        A controller that was reset counts from where it stands: a move from there would lead anywhere.
        """
        positions_deg = {role: axis.position_deg() for role, axis in self._bench.axes.items()}
        for role, left_deg in self._left_deg.items():
            axis = self._bench.axes[role]
            if role not in self._sent and abs(positions_deg[role] - left_deg) > axis.tolerance_deg:
                raise PositionError(
                    axis.name,
                    f"stands at {positions_deg[role]:g} degrees although it was left at {left_deg:g} degrees: it was "
                    "moved by hand, or its controller was reset and counts from another zero",
                    not_done="nothing was moved; the last readings in the journal may have been taken elsewhere",
                    to_do="look where it truly stands, home it, then run the recipe again",
                )
        return positions_deg

    def require_slot(self, wanted: int) -> None:
        """Ask before and after every reading: a wheel can be turned by hand."""
        slot = self._bench.analyzer.slot()
        if slot != wanted:
            raise PositionError(
                self._bench.analyzer.name,
                f"{'no slot' if slot is None else f'slot {slot}'} is in the beam instead of slot {wanted}",
                not_done="no reading was stored that this may have spoilt",
                to_do="check that nothing holds the analyzer and that nobody turned it by hand, then run the recipe "
                "again",
            )

    def _move(self, target: Target) -> None:
        """Start every motion that the target needs, then wait until all have ended and settled.

        What was sent and did not arrive is sent again, wherever it stands: it has not come there as it should.
        """
        axes, analyzer = self._bench.axes, self._bench.analyzer
        here_deg = self.require_still_there()
        targets_deg = {
            role: angle_deg
            for role, angle_deg in target.axes_deg.items()
            if role in self._sent or abs(here_deg[role] - angle_deg) > axes[role].tolerance_deg
        }
        turns = analyzer.slot() != target.slot or _ANALYZER in self._sent
        settles_s = [axes[role].settle_s for role in targets_deg] + [analyzer.settle_s] * turns
        moving: list[RotaryAxis | Analyzer] = []
        if turns:
            self._sent.add(_ANALYZER)
            analyzer.start_select(target.slot)
            moving.append(analyzer)
        for together in self._bench.order(targets_deg):
            for role in together:
                self._sent.add(role)
                axes[role].start_move(targets_deg[role])
            arms = [axes[role] for role in together]
            moving = until_at_rest([*arms, *moving], arms, self._wait)
        until_at_rest(moving, moving, self._wait)
        if settles_s:
            self._wait(max(settles_s))

    def _read_back(self, target: Target) -> tuple[float, ...]:
        positions_deg = []
        for role, target_deg in target.axes_deg.items():
            axis = self._bench.axes[role]
            position_deg = axis.position_deg()
            if abs(position_deg - target_deg) > axis.tolerance_deg:
                raise PositionError(
                    axis.name,
                    f"stands at {position_deg:g} degrees after a move to {target_deg:g} degrees "
                    f"(tolerance {axis.tolerance_deg:g} degrees)",
                    not_done="the readings there",
                    to_do="check that nothing touches the stage, home it, then run the recipe again",
                )
            positions_deg.append(position_deg)
        self._left_deg = target.axes_deg
        self._sent.clear()
        return tuple(positions_deg)


def until_at_rest(
    moving: list[RotaryAxis | Analyzer],
    needed: Sequence[RotaryAxis | Analyzer],
    wait: Callable[[float], None],
) -> list[RotaryAxis | Analyzer]:
    """Wait until the needed devices have arrived; returns the others that still move."""
    while any(device in moving for device in needed):
        wait(POLL_S)
        moving = [device for device in moving if device.is_moving()]
    return moving
