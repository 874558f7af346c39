"""How the maps of many directions stand on a page: beside each other in one block, or in several below each other."""

from __future__ import annotations

from dataclasses import dataclass

from goniometer.map_drawing.sheet import LEFT_IN, fitting

GAP_IN, LEGEND_IN = 0.12, 1.55
"""Between maps, and for the legends at their right."""
_WIDEST_IN, _HIGHEST_IN = 15.9, 8.6
_MAP_IN, _LEAST_IN, _LINE_IN, _BELOW_IN = 2.3, 0.8, 0.17, 0.55
_ROWS = 3


@dataclass(frozen=True)
class Blocks:
    """Blocks of three rows of maps, S0, DoLP and AoLP; a column is a direction."""

    columns: int
    count: int
    width_in: float
    height_in: float
    names_in: float

    @property
    def down_in(self) -> float:
        """From a row to the next; a legend needs some room even beside flat maps."""
        return max(self.height_in, _LEAST_IN) + GAP_IN

    @property
    def legend_height_in(self) -> float:
        """Of the legend beside a row."""
        return self.down_in - GAP_IN

    @property
    def beside_in(self) -> float:
        """Where the legends begin."""
        return LEFT_IN + self.columns * (self.width_in + GAP_IN) + 0.05

    @property
    def total_in(self) -> float:
        """From the first block's names to the last row of maps."""
        return self.count * self._block_in + (self.count - 1) * _BELOW_IN

    @property
    def page_in(self) -> float:
        """How wide the page is."""
        return LEFT_IN + self.columns * (self.width_in + GAP_IN) + LEGEND_IN

    @property
    def _block_in(self) -> float:
        return self.names_in + (_ROWS - 1) * self.down_in + self.height_in

    def top_in(self, block: int, row: int) -> float:
        """Upper edge of a row of maps."""
        return block * (self._block_in + _BELOW_IN) + self.names_in + row * self.down_in


def arranged(shape: tuple[int, int], directions: int, lines: int) -> Blocks:
    """The arrangement in which maps of so many rows and columns are largest; one block where more are no gain.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of a map.
    directions : int
        How many there are.
    lines : int
        How many lines the name of a direction has.
    """
    names_in = 0.1 + _LINE_IN * lines
    best: Blocks | None = None
    for count in range(1, directions + 1):
        columns = -(-directions // count)
        room_in = (_WIDEST_IN - LEFT_IN - LEGEND_IN) / columns - GAP_IN
        high_in = ((_HIGHEST_IN + _BELOW_IN) / count - _BELOW_IN - names_in + GAP_IN) / _ROWS - GAP_IN
        if high_in < _LEAST_IN:
            break
        found = Blocks(columns, -(-directions // columns), *fitting(shape, min(room_in, _MAP_IN), high_in), names_in)
        if best is None or found.width_in > 1.05 * best.width_in:
            best = found
    assert best is not None, "one block always fits"
    return best
