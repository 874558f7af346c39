"""What an earlier process has stored of a scan, and from where the scan is taken up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from acquisition.journal import StoredReading
from acquisition.readings import Reading
from acquisition.steps import Step, Target


@dataclass(frozen=True, eq=False)
class Earlier:
    """The readings that are there, and the steps that they are of.

    Parameters
    ----------
    rows : tuple of StoredReading
        In the order they were taken; none for a new scan.
    steps : tuple of Step
        Those up to the step of the last planned reading, with as many readings as each has; the last one with as many
        as it should have.
    references : callable
        The steps by which the lamp is read anew, at a point; none for a recipe without references.
    alike : callable
        Whether two readings at the same place may be of the same light.
    is_steady : bool
        Whether nothing has held the earlier process up that would not come again, such as a lost link.
    spent_s : float
        How much of the bench's time the scan has taken so far, without what was lost.
    """

    rows: tuple[StoredReading, ...] = ()
    steps: tuple[Step, ...] = ()
    references: Callable[[int], Sequence[Step]] = lambda point: ()
    alike: Callable[[Reading, Reading], bool] = lambda before, now: True
    is_steady: bool = True
    spent_s: float = 0.0

    @property
    def planned(self) -> tuple[Reading, ...]:
        """The readings that the plan has."""
        return tuple(row.reading for row in self.rows if row.is_planned)

    @property
    def ended_s(self) -> float:
        """When the last reading was over, on the bench's clock."""
        return max(row.reading.time_s + row.reading.exposure_s for row in self.rows)

    @property
    def visited(self) -> tuple[Step, ...]:
        """The steps of which a reading is there."""
        return tuple(step for step in self.steps if step.readings)

    @property
    def of_last_step(self) -> tuple[StoredReading, ...]:
        """What was taken from the last step's first reading on."""
        planned = [number for number, row in enumerate(self.rows) if row.is_planned]
        return self.rows[planned[sum(step.readings for step in self.steps[:-1])] :]

    @property
    def can_come_again(self) -> bool:
        """Whether the last step goes as it went, when it begins at the same time in virtual time."""
        return self.is_steady and all(row.is_planned for row in self.of_last_step)

    @property
    def way(self) -> tuple[Target, ...]:
        """Places over which the bench comes to the last step but one as if it had come all the way, and that one."""
        return way_to([step.target for step in self.visited[:-1]])


def way_to(targets: Sequence[Target]) -> tuple[Target, ...]:
    """Those of the targets at which an axis, analyzer or generator stood before it turned last, and the last one.

    By them play is taken up from the same side, and none of them is a place that the scan has not come by.
    """
    before: dict[str, int] = {}
    for number, (here, there) in enumerate(pairwise(targets)):
        stands, goes = (
            {**target.axes_deg, "analyzer": target.slot, "generator": target.generator} for target in (here, there)
        )
        before.update({name: number for name in stands if stands[name] != goes[name]})
    return (*(targets[number] for number in sorted(set(before.values()))), *targets[-1:])
