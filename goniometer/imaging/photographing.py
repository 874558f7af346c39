"""A bench whose camera takes as many exposures in each reading as a recipe asks for."""

from __future__ import annotations

from dataclasses import replace

from acquisition.engine import Bench
from acquisition.imaging.exposures import Exposures
from acquisition.protocols import Camera
from acquisition.recipe import Recipe


def photographing(bench: Bench, recipe: Recipe) -> Bench:
    """The bench with a detector whose pictures are stored with its readings."""
    assert isinstance(bench.detector, Camera), "what a rig names as a camera is driven as one"
    return replace(bench, detector=Exposures(bench.detector, recipe.imaging.exposures if recipe.imaging else (1.0,)))
