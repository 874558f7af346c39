"""Published polarimetric reflectance models, each a `Surface` under its authors' name, to compare with."""

from __future__ import annotations

from model.literature.baek import Baek2018
from model.literature.hao import Hao2023
from model.literature.hyde import Hyde
from model.literature.priest_germer import PriestGermer
from model.literature.published import PublishedModel
from model.literature.three_component import ThreeComponent

__all__ = ["Baek2018", "Hao2023", "Hyde", "PriestGermer", "PublishedModel", "ThreeComponent"]
