"""What all sections of a user's file share: no unknown keys, no converted values, and several faults in one report."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError

SectionFault = tuple[tuple[str | int, ...], str]
"""The keys that lead from the section to the value at fault, and what is wrong with it."""


class Section(BaseModel):
    """Frozen; an unknown key, text in place of a number, NaN and infinity are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def refuse_all(faults: Iterable[SectionFault]) -> None:
    """Refuse a section for all its faults at once; without any, do nothing.

    Raises
    ------
    PydanticCustomError
        Its context holds `faults`, so that a report can give each its own line.
    """
    faults = tuple(faults)
    if faults:
        text = "; ".join(f"{'.'.join(map(str, place))}: {what}" if place else what for place, what in faults)
        raise PydanticCustomError("faults", "{text}", {"text": text, "faults": faults})
