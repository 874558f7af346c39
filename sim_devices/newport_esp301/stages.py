"""The rotation stages at an ESP301."""

from __future__ import annotations

from typing import NamedTuple


class Esp301Stage(NamedTuple):
    """A stage: its model, one count of its encoder, and how fast it turns at most."""

    model: str
    step_deg: float
    top_deg_s: float


STAGES = {
    stage.model: stage
    for stage in (
        Esp301Stage("URS75CC", 0.0005, 20.0),
        Esp301Stage("URS100CC", 0.0005, 20.0),
        Esp301Stage("URS150CC", 0.0005, 20.0),
        Esp301Stage("PR50CC", 0.001, 20.0),
        Esp301Stage("SR50CC", 0.001, 4.0),
    )
}
URS150CC = STAGES["URS150CC"]
