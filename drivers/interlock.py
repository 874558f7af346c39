"""The rule that no axis is moved into another: asked by every move, whoever asks for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from drivers.axis import Axis
from drivers.collision_zones import Zone, entered, free_order
from goniometer.errors import CollisionError


class Interlock:
    """Watches over axes that can touch each other or something else.

    Parameters
    ----------
    zones : sequence of Zone
        What no path may enter.
    axes : mapping of str to Axis
        Every axis of the bench, by role. Each asks this interlock from now on.

    Raises
    ------
    DeviceFaultError
        When an axis moves already: where to, only who sent it knows. Also without zones, for nothing can be read or
        planned on a bench that moves.
    """

    def __init__(self, zones: Sequence[Zone], axes: Mapping[str, Axis]) -> None:
        self._zones, self._axes = tuple(zones), dict(axes)
        for axis in self._axes.values():
            axis.require_rest()
        for role, axis in self._axes.items() if self._zones else ():
            axis.permit = partial(self._permit, role)

    def order(self, standing_deg: Mapping[str, float], targets_deg: Mapping[str, float]) -> tuple[tuple[str, ...], ...]:
        """The roles that move together, in turn, so that no path enters a zone: all at once where that is free.

        Where the axes stand was read a moment ago; each start asks them again.

        Raises
        ------
        CollisionError
            When there is no such order; nothing was moved.
        """
        if not self._zones:
            return (tuple(targets_deg),)
        ways = {role: self._axes[role].way_deg(standing_deg[role], there) for role, there in targets_deg.items()}
        order = free_order(self._zones, standing_deg, ways)
        if order is None:
            spans = {role: (angle_deg, angle_deg) for role, angle_deg in standing_deg.items()}
            if (zone := entered(self._zones, spans)) is not None:
                raise _standing(standing_deg, zone)
            spans |= {role: (min(way), max(way)) for role, way in ways.items()}
            zone = entered(self._zones, spans)
            assert zone is not None, "an order without a free path has a zone on it"
            aim = " and ".join(f"{role} to {there:g}" for role, there in targets_deg.items())
            raise _refused(" and ".join(targets_deg), f"the way of {aim} degrees", zone)
        return order

    def _permit(self, role: str, way_deg: Sequence[float]) -> None:
        spans = {other: axis.span_deg() for other, axis in self._axes.items() if other != role}
        spans[role] = (min(way_deg), max(way_deg))
        if zone := entered(self._zones, spans):
            raise _refused(role, f"the way from {way_deg[0]:g} to {way_deg[-1]:g} degrees", zone)


def _standing(standing_deg: Mapping[str, float], zone: Zone) -> CollisionError:
    places = ", ".join(f"{role} {angle_deg:g}" for role, angle_deg in standing_deg.items())
    return CollisionError(
        " and ".join(standing_deg),
        f"the axes stand in a collision zone, at {places} degrees: {zone.describe()}",
        not_done="no move was begun, for each would begin in it",
        to_do="bring them out by hand or by the controller's own panel, or look whether they stand where they say; a "
        "simulated bench begins where start_deg in its scene says",
    )


def _refused(name: str, way: str, zone: Zone) -> CollisionError:
    return CollisionError(
        name,
        f"{way} enters a collision zone: {zone.describe()}",
        not_done="the move was refused and nothing was moved",
        to_do="move the other axes out of the way first, or change the angles; collision_zones in the rig file says "
        "where parts would touch",
    )
