"""Which pictures are of one exposure and gain: a camera that says what it applied never says quite the same twice."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol, TypeVar

_SAME_EXPOSURE = 2.5e-3
"""Drivers take a picture that is 0.1 % off what was asked for, so two of one exposure may be 0.2 % apart. The dark
current of so small a share is nothing."""

_SAME_DB = 0.015
"""Likewise 0.005 dB."""


class Exposed(Protocol):
    """A picture, or what is stored of it."""

    @property
    def exposure_s(self) -> float:
        """How long light was collected."""

    @property
    def gain_db(self) -> float:
        """The amplifier's."""


Setting = tuple[float, float]
"""Gain in dB and exposure in s, as the first picture of several has them."""

Picture = TypeVar("Picture", bound=Exposed)


def is_same_exposure(one_s: float, other_s: float) -> bool:
    """Whether two exposures were asked for as one."""
    return math.isclose(one_s, other_s, rel_tol=_SAME_EXPOSURE)


def is_same_gain(one_db: float, other_db: float) -> bool:
    """Whether two gains were asked for as one."""
    return abs(one_db - other_db) <= _SAME_DB


def setting_of(picture: Exposed, known: Iterable[Setting]) -> Setting:
    """The one of the known settings with which a picture was taken, or else its own; pictures of one gain share it."""
    known = tuple(known)
    gain_db = next((gain_db for gain_db, _ in known if is_same_gain(gain_db, picture.gain_db)), picture.gain_db)
    at_gain = (setting for setting in known if setting[0] == gain_db)
    own = gain_db, picture.exposure_s
    return next((setting for setting in at_gain if is_same_exposure(setting[1], picture.exposure_s)), own)


def by_setting(pictures: Iterable[Picture]) -> dict[Setting, list[Picture]]:
    """Pictures of one exposure and gain together, in the order in which they come."""
    groups: dict[Setting, list[Picture]] = {}
    for picture in pictures:
        groups.setdefault(setting_of(picture, groups), []).append(picture)
    return groups
