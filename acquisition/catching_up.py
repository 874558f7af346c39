"""Brings a bench back to where an earlier process has left a scan, so that it goes on as if it had never been cut."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace

from acquisition.earlier import Earlier
from acquisition.readings import Reading
from acquisition.signal_to_noise import Enough
from acquisition.steps import Step, Target
from drivers.clock import Clock
from goniometer.errors import DeviceFaultError


class CatchingUp:
    """Passes over the steps that are there already, and takes the scan up at the last of them.

    In virtual time a scan follows from how a step begins. So the bench goes to that step's place, from where it had
    come there and has read the light once more, the step's time is waited for, and its readings are taken as they were.
    All of these are compared with what is stored instead of stored. Where it is too late for that, as on every real
    bench, time was lost: only the step's last reading is compared, and the lamp is read anew. Behind an analyzer that
    turns, no reading is at the angle of another, and none is compared then.

    Parameters
    ----------
    earlier : Earlier
        What is there.
    clock : Clock
        The bench's clock.
    check : callable
        Raises to end the scan.
    come_by : callable
        Brings the bench to a place on its way, and sees that it stands there.
    arrive : callable
        Brings the bench to a place.
    take : callable
        Takes all readings of a step, and leaves for a place or stays.
    tell : callable
        Called with each reading that is there, in order.
    enough : callable
        Told the steps that are there, for what it says of later ones may hang by them.
    lose : callable
        Told how much of the bench's time was lost, before the scan goes on.

    Attributes
    ----------
    is_planned : bool
        Whether the readings that are taken now are in the plan.
    """

    def __init__(
        self,
        earlier: Earlier,
        clock: Clock,
        check: Callable[[], None],
        *,
        come_by: Callable[[Target], None],
        arrive: Callable[[Target], None],
        take: Callable[[Step, Target | None], None],
        tell: Callable[[Reading], None],
        enough: Enough,
        lose: Callable[[float], None],
    ) -> None:
        self._earlier, self._clock, self._check = earlier, clock, check
        self._come_by, self._arrive, self._take, self._tell = come_by, arrive, take, tell
        self._enough, self._lose = enough, lose
        self._steps = len(earlier.steps)
        self._rows = deque(earlier.rows)
        self._to_compare: deque[Reading] = deque()
        self.is_planned = True

    def passes_over(self, step: Step) -> bool:
        """Whether all readings of a step are there already, and some of a later one; they are told then."""
        if self._steps <= 1:
            return False
        readings = self._earlier.steps[-self._steps].readings
        self._steps -= 1
        there: list[Reading] = []
        while len(there) < readings:
            row = self._rows.popleft()
            self._tell(row.reading)
            if row.is_planned:
                there.append(row.reading)
        if there:
            self._enough(replace(step, exposure_s=there[-1].exposure_s), [reading.power_w for reading in there])
        return True

    @property
    def is_behind(self) -> bool:
        """Whether the scan is still to be taken up."""
        return self._steps > 0

    @property
    def is_at_last(self) -> bool:
        """Whether it is to be taken up at the next step."""
        return self._steps == 1

    def take_up(self, step: Step) -> tuple[Reading, ...]:
        """Tell what is there of a step, if it is the last such, and bring the bench to where the scan was cut.

        Returns
        -------
        tuple of Reading
            Those of the step that need not be taken; none when they come again, to be compared.

        Raises
        ------
        DeviceFaultError
            When another light is seen than before.
        """
        self._to_compare.clear()  # the rest of the step before may have been skipped
        if not self._steps:
            return ()
        self._steps = 0
        while self._rows:
            self._tell(self._rows.popleft().reading)
        tail, planned = self._earlier.of_last_step, self._earlier.planned
        there = sum(row.is_planned for row in tail)
        steps = self._earlier.visited
        for place in self._earlier.way[:-1]:
            self._come_by(place)
        if len(steps) > 1:
            self._compare_one(steps[-2], planned[-there - 1], step.target)
        self._arrive(step.target)
        self._wait_until(tail[0].reading.time_s)
        if self._earlier.can_come_again and self._clock.now() == tail[0].reading.time_s:
            self._to_compare.extend(planned[-there:])
            return ()
        self._wait_until(self._earlier.ended_s)
        self._compare_one(step, planned[-1], None)
        self._lose(self._clock.now() - self._earlier.ended_s)
        self.is_planned = False
        for reference in self._earlier.references(step.point):
            self._take(reference, None)
        self.is_planned = True
        return planned[-there:]

    def compares(self, reading: Reading) -> bool:
        """Whether a reading is only to be compared with one that is there; raises DeviceFaultError on another light."""
        if not self._to_compare:
            return False
        there = self._to_compare.popleft()
        if not self._earlier.alike(there, reading):
            raise _other_light(there, reading)
        return True

    def _compare_one(self, step: Step, there: Reading, after: Target | None) -> None:
        if step.rotation is not None:
            self._come_by(step.target)
            return
        self._to_compare.append(there)
        self._take(replace(step, readings=1), after)

    def _wait_until(self, time_s: float) -> None:
        """Let time pass on a simulated clock that is behind; half of it at a time, so that no rounding is left."""
        while (left_s := time_s - (now_s := self._clock.now())) > 0:
            self._check()
            self._clock.sleep(left_s if now_s >= time_s / 2 else left_s / 2)


def _other_light(before: Reading, now: Reading) -> DeviceFaultError:
    return DeviceFaultError(
        "detector",
        f"it reads {now.power_w:.4g} W at exit {now.exit_deg:g} degrees in slot {now.slot}, where "
        f"{before.power_w:.4g} W are stored from before the scan was cut: lamp, sample or detector are not what they "
        "were",
        not_done="no reading was stored; the run is as it was",
        to_do="let the lamp warm up, look at sample and detector, then resume once more; if the light cannot be "
        "brought back, run the recipe anew",
    )
