"""What all sections of a scene share: no unknown keys, and numbers that are numbers."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class ScenePart(BaseModel):
    """Frozen; text and booleans are not taken for numbers, and infinities and NaN are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
