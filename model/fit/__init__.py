"""Fits of surfaces to measured light."""

from __future__ import annotations

from model.fit.dataset import Dataset
from model.fit.family import SurfaceFamily
from model.fit.fit import fit, follow
from model.fit.lobe_family import lobe_family
from model.fit.result import Estimate, FitResult

__all__ = ["Dataset", "Estimate", "FitResult", "SurfaceFamily", "fit", "follow", "lobe_family"]
