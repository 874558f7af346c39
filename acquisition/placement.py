"""Brings the bench where a step wants it, and sees that it stays there."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from acquisition.events import AxisSentAgain
from acquisition.expand import Target
from acquisition.filters import ToldWavelength
from acquisition.protocols import Analyzer, RotaryAxis
from acquisition.selector import Selector
from acquisition.timing import DUE_POLL_S, FRESH_S, POLL_S
from drivers.clock import Clock
from goniometer.errors import DeviceError, PositionError

if TYPE_CHECKING:
    from acquisition.engine import Bench

_MARGIN_S = 0.0005
"""How long after it should have arrived a device is asked first: a question that comes too early costs another one."""

_OVERDUE_S = 0.05
"""How long after it should have arrived a device is asked in quick succession."""


_NEAR = 10.0
"""Tolerances within which a miss may be play or friction; beyond, something has happened that a person should see."""


class Astray(Exception):
    """An axis has not come close enough to where it was sent, and may be sent again; never leaves the readout."""

    def __init__(self, event: AxisSentAgain) -> None:
        self.event = event
        super().__init__(str(event))


class Placement:
    """Where the bench stands, as its devices say, and was left.

    Parameters
    ----------
    bench : Bench
        The devices.
    clock : Clock
        The bench's clock.
    wait : callable
        Lets time pass; raises to end the scan.
    """

    def __init__(self, bench: Bench, clock: Clock, wait: Callable[[float], None]) -> None:
        self._bench, self._clock, self._wait = bench, clock, wait
        self._left_deg: dict[str, float] = {}
        self._sent: set[str] = set()
        self._seen_deg: tuple[dict[str, float], float] | None = None
        self._analyzer = Selector(bench.analyzer, "analyzer")
        self._generator = None if bench.generator is None else Selector(bench.generator, "generator")
        self._filters = None if bench.filters is None else bench.filters.selector()
        self._told = None if bench.filters is None else ToldWavelength(bench.filters, bench.detector)
        self._at: Target | None = None
        self._way: _Way | None = None
        self._sent_again: Counter[str] = Counter()

    def leave(self) -> None:
        """Take nothing for granted: `arrive` asks every device again where it stands."""
        self._at = self._way = self._seen_deg = None
        for selector in (self._analyzer, self._generator, self._filters):
            if selector is not None:
                selector.forget()
        if self._told is not None:
            self._told.forget()

    def depart(self, target: Target) -> None:
        """Begin to bring the axes to a target; analyzer and generator stay, to be asked still.

        Raises
        ------
        PositionError
            When an axis is not where it was left; nothing is moved.
        CollisionError
            When there is no safe way; nothing is moved.
        """
        here_deg = self._still_there_deg()
        targets_deg = {
            role: angle_deg
            for role, angle_deg in self._axes_deg(target).items()
            if role in self._sent or abs(here_deg[role] - angle_deg) > self._bench.axes[role].tolerance_deg
        }
        self._at = self._seen_deg = None
        self._way = _Way(target, targets_deg, deque(self._bench.order(here_deg, targets_deg)))
        self._go_on(self._way)

    def departure(self, target: Target) -> DeviceError | None:
        """Depart unless the scan is to end; returns what went wrong, for readings with their light are stored first."""
        self._wait(0.0)  # nothing is set in motion that was to be stopped
        try:
            self.depart(target)
        except DeviceError as failure:
            return failure
        return None

    def arrive(self, target: Target) -> None:
        """Bring the bench to a target and let it settle, unless it has arrived there and did not leave.

        Where its axes are is read back by `read_back`, once a reading has begun.

        Raises
        ------
        PositionError
            When an axis was not where it was left, nothing being moved, or another slot is in the beam.
        """
        if self._at == target:
            return
        if self._way is not None and self._way.target != target:
            self._end(self._way)
        if self._way is None:
            self.depart(target)
        assert self._way is not None, "it has departed"
        self._at, way = None, self._way
        for selector, slot in self._selected(target):
            if selector.begin(slot):
                way.moving.append(selector.device)
        self._end(way)
        if self._told is not None and target.filter_slot is not None:
            self._told.tell(target.filter_slot)
        self.require_slots(target)
        self._wait(max(way.settled_s - self._clock.now(), 0.0))
        self._at = target

    def send_analyzer(self, slot: int) -> None:
        """Send the analyzer to a slot, on the way to which light is read; `arrive` then waits for it."""
        self._analyzer.send(slot)

    def ask_analyzer(self) -> None:
        """Take nothing for granted of the analyzer: `arrive` asks it where it stands, and brings it back."""
        self._at = None
        self._analyzer.forget()

    def require_still_there(self) -> dict[str, float]:
        """Ask every axis where it is; raises PositionError when one is not where it was left.

        A controller that was reset counts from where it stands: a move from there would lead anywhere.
        """
        self._seen_deg = None
        return self._still_there_deg()

    def require_slots(self, target: Target) -> None:
        """Ask analyzer, generator and filters which slots are in the beam; raises PositionError when others are."""
        for selector, slot in self._selected(target):
            selector.require(slot)

    def read_back(self, *, anew: bool) -> tuple[float, ...]:
        """Ask every axis where it is, at the target where the bench has arrived.

        Parameters
        ----------
        anew : bool
            Whether also when they have said so a moment ago.

        Returns
        -------
        tuple of float
            The angles, in degrees: incidence, exit, azimuth, and exit azimuth where the bench has that axis.

        Raises
        ------
        PositionError
            When an axis has not come to where it was sent, or does not stand there any more.
        Astray
            When one has missed its target by little and may be sent again, which `arrive` does.
        """
        assert self._at is not None, "asked only where the bench has arrived"
        if anew:
            self._seen_deg = None
        positions_deg, asked_s = self._positions_deg()
        targets_deg = self._axes_deg(self._at)
        for role, target_deg in targets_deg.items():
            axis, position_deg = self._bench.axes[role], positions_deg[role]
            if abs(position_deg - target_deg) > axis.tolerance_deg:
                self._send_again(role, positions_deg, target_deg)
                raise PositionError(
                    axis.name,
                    f"stands at {position_deg:g} degrees after a move to {target_deg:g} degrees "
                    f"(tolerance {axis.tolerance_deg:g} degrees)",
                    not_done="the readings there",
                    to_do="check that nothing touches the stage, home it, then run the recipe again",
                )
        self._left_deg, self._seen_deg = targets_deg, (positions_deg, asked_s)
        self._sent.clear()
        self._sent_again.clear()
        for selector, _ in self._selected(self._at):
            selector.arrived()
        return tuple(positions_deg[role] for role in targets_deg)

    def _axes_deg(self, target: Target) -> dict[str, float]:
        """Where a target wants the axes that the bench has."""
        return {role: angle_deg for role, angle_deg in target.axes_deg.items() if role in self._bench.axes}

    def _send_again(self, role: str, positions_deg: Mapping[str, float], target_deg: float) -> None:
        """Have an axis sent again that has missed its target by little, as often as its rig allows.

        All are left where they stand: if one stands elsewhere when the bench departs, nothing is moved.
        """
        axis, most = self._bench.axes[role], self._bench.position_retries.get(role, 0)
        is_near = abs(positions_deg[role] - target_deg) <= _NEAR * axis.tolerance_deg
        if role not in self._sent or not is_near or self._sent_again[role] >= most:
            return
        self._sent_again[role] += 1
        self._left_deg = dict(positions_deg)
        self._sent.clear()
        self._at = self._seen_deg = None
        raise Astray(AxisSentAgain(axis.name, positions_deg[role], target_deg, self._sent_again[role], most))

    def _selected(self, target: Target) -> Iterator[tuple[Selector, int]]:
        yield self._analyzer, target.slot
        for selector, slot in ((self._generator, target.generator), (self._filters, target.filter_slot)):
            if slot is not None:
                assert selector is not None, "a recipe is only accepted on a bench that has what it names"
                yield selector, slot

    def _still_there_deg(self) -> dict[str, float]:
        positions_deg, _ = self._positions_deg()
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

    def _positions_deg(self) -> tuple[dict[str, float], float]:
        """Where the axes say they are, and when they began to say so, a moment ago if they rest since."""
        if self._seen_deg is None or self._clock.now() - self._seen_deg[1] > FRESH_S:
            self._seen_deg = None
            asked_s = self._clock.now()
            return {role: axis.position_deg() for role, axis in self._bench.axes.items()}, asked_s
        return self._seen_deg

    def _go_on(self, way: _Way) -> None:
        """Start the axes that move together next."""
        for role in way.order.popleft() if way.order else ():
            self._sent.add(role)
            axis = self._bench.axes[role]
            axis.start_move(way.targets_deg[role])
            way.moving.append(axis)

    def _end(self, way: _Way) -> None:
        """Wait until all has arrived that is on its way or is to follow."""
        while way.moving:
            if way.order and all(device in self._bench.selectors for device in way.moving):
                self._go_on(way)
            self._clock.sleep(0.0)  # in virtual time what was just sent may still be answered; then the clock stands
            self._wait(_pause_s(way.moving))
            moving = [device for device in way.moving if device.is_moving()]
            for device in way.moving:
                if device not in moving:
                    way.settled_s = max(way.settled_s, self._rested_s(device) + device.settle_s)
            way.moving = moving
            if way.order and not moving:
                self._go_on(way)
        self._way = None

    def _rested_s(self, device: RotaryAxis | Analyzer) -> float:
        return device.rested_s if isinstance(device, RotaryAxis) else self._clock.now()


@dataclass
class _Way:
    """How the bench gets to a target: axes that are to move together, in turn, and what moves now."""

    target: Target
    targets_deg: Mapping[str, float]
    order: deque[tuple[str, ...]]
    moving: list[RotaryAxis | Analyzer] = field(default_factory=list)
    settled_s: float = 0.0


def _pause_s(moving: Sequence[RotaryAxis | Analyzer]) -> float:
    """How long to wait until the next question: to when the first of them should arrive, and then not for long."""
    remaining_s = min(device.remaining_s() for device in moving) + _MARGIN_S
    if remaining_s > DUE_POLL_S:
        return remaining_s if remaining_s < 2 * POLL_S else POLL_S
    return DUE_POLL_S if remaining_s > -_OVERDUE_S else POLL_S
