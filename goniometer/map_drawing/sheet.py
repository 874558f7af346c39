"""A page for maps, laid out in inches from its upper left corner: the maps' shape decides how high it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from goniometer.plot_style import FAINT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

LEFT_IN, HEAD_IN, FOOT_IN = 0.7, 0.95, 0.8
REMARK_IN = 0.62
"""From the lower edge of a map to what its colours leave out."""
_LINE_IN, _KEY_IN = 0.2, 0.3


class MapSheet:
    """A figure with a head above its maps, and below them a key and remarks.

    Parameters
    ----------
    width_in, maps_in : float
        Width of the page, and height of all that stands between head and foot.
    key : sequence of Patch
        What colours do not show; no room is left for an empty one.
    remarks : sequence of str
        Lines below it.
    """

    def __init__(self, width_in: float, maps_in: float, key: Sequence[Patch] = (), remarks: Sequence[str] = ()) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self._width_in = width_in
        key_in = _KEY_IN if key else 0.0
        self._height_in = HEAD_IN + maps_in + FOOT_IN + key_in + _LINE_IN * len(remarks)
        self.figure: Figure = Figure(figsize=(width_in, self._height_in))
        FigureCanvasAgg(self.figure)
        if key:
            self._key(key, maps_in + FOOT_IN + 0.08)
        for line, remark in enumerate(remarks):
            self.remark(LEFT_IN, maps_in + FOOT_IN + key_in + 0.05 + _LINE_IN * line, remark)

    def head(self, title: str, details: str) -> None:
        """Write what was measured, and how."""
        left = LEFT_IN / self._width_in
        self.figure.text(
            left, 1.0 - 0.38 / self._height_in, title, size=16, weight="bold", va="center", parse_math=False
        )
        self.figure.text(left, 1.0 - 0.70 / self._height_in, details, color=FAINT, va="center")

    def axes(self, left_in: float, top_in: float, width_in: float, height_in: float, **choices: Any) -> Axes:
        """Add axes; the top counts from the end of the head."""
        bottom = self._height_in - HEAD_IN - top_in - height_in
        place = (left_in / self._width_in, bottom / self._height_in, width_in / self._width_in)
        return self.figure.add_axes((*place, height_in / self._height_in), **choices)

    def remark(self, left_in: float, top_in: float, text: str) -> None:
        """Write a small text; the top counts from the end of the head."""
        at = (left_in / self._width_in, 1.0 - (HEAD_IN + top_in) / self._height_in)
        self.figure.text(*at, text, size="small", color=FAINT, va="center", parse_math=False)

    def _key(self, entries: Sequence[Patch], below_in: float) -> None:
        at = (LEFT_IN / self._width_in, 1.0 - (HEAD_IN + below_in) / self._height_in)
        self.figure.legend(
            handles=list(entries), loc="center left", bbox_to_anchor=at, ncols=len(entries), borderaxespad=0.0
        )


def fitting(shape: tuple[int, int], width_in: float, most_in: float) -> tuple[float, float]:
    """Width and height in inches of a map of so many rows and columns that fits into both."""
    height, width = shape
    scale = min(width_in / width, most_in / height)
    return width * scale, height * scale
