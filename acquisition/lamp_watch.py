"""What has to be kept of readings to follow the lamp: the last references, and what no reference closes yet."""

from __future__ import annotations

from acquisition.lamp_level import reference_groups
from acquisition.readings import Reading

_KEPT = 2
"""References at the end that are kept beside the first: the stretch between them is the one that is looked at."""


class LampWatch:
    """Remembers readings for the lamp's level; what has been looked at is dropped, so that a long scan takes no room.

    References lie between directions, and each direction that ends is looked at. So the readings before the last
    reference but one are never asked for again, unless directions are repeated.

    Parameters
    ----------
    forgets : bool
        False where directions that have ended go on later.
    """

    def __init__(self, *, forgets: bool = True) -> None:
        self._forgets = forgets
        self._references: list[Reading] = []
        self._darks: dict[int, list[Reading]] = {}
        self._between: list[Reading] = []
        self._groups = 0
        self._ended: int | None = None

    def add(self, reading: Reading) -> None:
        """Remember a reading that has been stored."""
        if reading.kind == "reference":
            self._groups += reading.repeat == 0
            self._references.append(reading)
        elif reading.kind == "dark":
            self._darks.setdefault(reading.point, []).append(reading)
        elif self._references:
            self._between.append(reading)

    def of_lamp(self) -> list[Reading]:
        """The first reference and the last ones, and the dark readings of their directions as far as they are taken."""
        points = dict.fromkeys(reference.point for reference in self._references)
        return [*self._references, *(dark for point in points for dark in self._darks.get(point, ()))]

    def in_question(self) -> list[Reading]:
        """`of_lamp`, and the signals whose lamp level is not settled; none before the first reference."""
        return [*self.of_lamp(), *self._between]

    def end_point(self, point: int) -> None:
        """Drop what is settled, now that this direction has ended; a reference that closes the scan needs its dark."""
        if not self._forgets:
            return
        of_references = {reference.point for reference in self._references}
        if self._ended != point and self._ended not in of_references:
            self._darks.pop(self._ended, None)  # type: ignore[arg-type]
        self._ended = point
        if self._groups > 1 + _KEPT:
            self._drop_settled()

    def _drop_settled(self) -> None:
        first, *others = reference_groups(self._references)
        kept, dropped = others[-_KEPT:], others[:-_KEPT]
        self._references = [reference for group in (first, *kept) for reference in group]
        self._groups = 1 + len(kept)
        points = {self._ended, *(reference.point for reference in self._references)}
        for group in dropped:
            if group[0].point not in points:
                self._darks.pop(group[0].point, None)
        since_s = kept[0][0].time_s
        self._between = [signal for signal in self._between if signal.time_s >= since_s]
