"""What published models have in common: they are surfaces that say whose they are."""

from __future__ import annotations

from typing import ClassVar

from model.surface import Surface


class PublishedModel(Surface):
    """A surface made of the lobes that a publication names.

    Attributes
    ----------
    source : str
        Whose model it is, and which reading of it was taken.
    """

    source: ClassVar[str]

    def describe(self) -> str:
        """Whose model it is, in which reading, and what its lobes are, one paragraph each."""
        return "\n".join([self.source, *(lobe.describe() for lobe in self.lobes)])
