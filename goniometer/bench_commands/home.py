"""`goniometer home`: the search for each stage's zero, one axis after the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from drivers.axis import HOMING_S
from drivers.clock import Clock
from drivers.collision_zones import Span, entered
from goniometer.bench_commands.open_bench import OpenAxes, Tell, open_axes, reachable_rig, roles_of, zones_about
from goniometer.errors import CollisionError, DeviceFaultError
from goniometer.rig_devices.entry import Role

_TELL_EVERY_S = 5.0


def home(
    rig_path: Path,
    roles: Sequence[Role],
    tell: Tell,
    note: Tell,
    *,
    way_is_clear: bool,
    trace: Path | None = None,
) -> None:
    """Home axes in the order given; all of them, source arm first, when none is given.

    Nothing is connected but these axes and those that they could touch. An alarm that homing cures is reset first.

    Parameters
    ----------
    rig_path : Path
        The rig file.
    roles : sequence of str
        The axes.
    tell, note : callable
        Take what happens, and what devices said on connecting.
    way_is_clear : bool
        Whether a person has seen to it that an axis can touch nothing wherever it goes.
    trace : Path, optional
        Where every byte sent and received is written down.

    Raises
    ------
    CollisionError
        When an axis could enter a collision zone on its way, which nobody knows; that axis and those after it were not
        moved.
    DeviceFaultError, ReplyTimeoutError
        When a stage does not find its zero.
    """
    roles = roles or roles_of(reachable_rig(rig_path))
    with open_axes(rig_path, roles, note, trace, to_home=True, alone=way_is_clear) as opened:
        for role in roles:
            if not way_is_clear:
                _refuse_zones(opened, role)
            _home(opened, role, tell)


def _home(opened: OpenAxes, role: Role, tell: Tell) -> None:
    axis, clock = opened.axes[role], opened.clock
    tell(f"{role}: searches its home position, {HOMING_S:g} s at most")
    start_s = clock.now()
    axis.start_homing()
    opened.until_at_rest(axis, _Patience(clock, role, tell))
    if not axis.is_homed():
        raise DeviceFaultError(
            axis.name,
            "its controller says that the search has ended, and that the zero is not known",
            not_done="the axis is not homed",
            to_do="look at the stage, its home switch and its cable, then home it again",
        )
    tell(f"{role}: homed after {clock.now() - start_s:.1f} s, stands at {axis.position_deg():.4f}°")


class _Patience:
    """Tells now and then how long a search has lasted."""

    def __init__(self, clock: Clock, role: Role, tell: Tell) -> None:
        self._clock, self._role, self._tell = clock, role, tell
        self._start_s = self._told_s = clock.now()

    def __call__(self) -> None:
        now_s = self._clock.now()
        if now_s - self._told_s >= _TELL_EVERY_S:
            self._told_s = now_s
            self._tell(f"{self._role}: still searching after {now_s - self._start_s:.0f} s")


def _refuse_zones(opened: OpenAxes, role: Role) -> None:
    """Raise CollisionError unless the axis may go anywhere in its limits, wherever axes not homed may be in theirs."""
    zones = zones_about(opened.rig, role)
    if not zones:
        return
    others = {other for zone in zones for other in zone.roles()}
    spans: dict[str, Span] = {other: opened.axes[other].span_deg() for other in opened.rig.axes() if other in others}
    low_deg, high_deg = opened.rig.axes()[role].limits_deg
    spans[role] = (min(low_deg, spans[role][0]), max(high_deg, spans[role][1]))
    if zone := entered([entry.zone() for entry in zones], spans):
        standing = ", ".join(f"{other} {_in_words(span)}" for other, span in spans.items() if other != role)
        raise CollisionError(
            role,
            f"the way to its home position is not known, and from {low_deg:g} to {high_deg:g} degrees it can enter a "
            f"collision zone: {zone.describe()} ({standing})",
            not_done="the axis was not homed and not moved",
            to_do="home or move the other axes out of the way first, or look that the way is clear and add "
            "--way-is-clear",
        )


def _in_words(span: Span) -> str:
    low_deg, high_deg = span
    return f"at {low_deg:g}°" if low_deg == high_deg else f"anywhere from {low_deg:g}° to {high_deg:g}°"
