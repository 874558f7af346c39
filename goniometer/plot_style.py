"""How this project's pictures look: colours, dashes, lines and letters."""

from __future__ import annotations

from typing import Any

DPI = 150
INK, FAINT, RULE, BAND = "#222222", "#6f6f6f", "#9a9a9a", "#e9e9e9"
# Okabe and Ito's palette, told apart with any colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6BB1")
# What a printer without colours shows too; and where curves lie on one another, gaps let the one below show.
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.4)))
STYLE: dict[Any, Any] = {
    "font.size": 9.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": RULE,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
}
