"""Refractive indices of common materials, from `materials.csv`, which names the source of every row."""

from __future__ import annotations

import csv
from difflib import get_close_matches
from functools import cache
from importlib.resources import files

import numpy as np


@cache
def _table() -> dict[str, list[tuple[float, complex]]]:
    text = (files("model") / "materials.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    table: dict[str, list[tuple[float, complex]]] = {}
    for row in rows:
        entry = (float(row["wavelength_nm"]), complex(float(row["n"]), float(row["k"])))
        table.setdefault(row["name"], []).append(entry)
    return {name: sorted(entries, key=lambda entry: entry[0]) for name, entries in table.items()}


def names() -> tuple[str, ...]:
    """Every material in the table."""
    return tuple(_table())


def index(name: str, wavelength_nm: float) -> complex:
    """Complex refractive index n + ik of a material, linear between the wavelengths in the table.

    Parameters
    ----------
    name : str
        One of `names()`.
    wavelength_nm : float
        Vacuum wavelength; never extrapolated.

    Raises
    ------
    ValueError
        If the material is not in the table, or the wavelength is outside what the table covers for it.
    """
    try:
        entries = _table()[name]
    except KeyError:
        near = get_close_matches(name.casefold(), [known.casefold() for known in names()], n=3, cutoff=0.5)
        nearest = [known for known in names() if known.casefold() in near] or names()
        raise ValueError(
            f"There is no material '{name}' in the table. Nearest known: {', '.join(nearest)}. "
            f"Choose one of these or give the index itself."
        ) from None
    wavelengths = [wavelength for wavelength, _ in entries]
    low, high = wavelengths[0], wavelengths[-1]
    if not low <= wavelength_nm <= high:
        covered = f"{low:g} nm only" if low == high else f"{low:g} nm to {high:g} nm"
        raise ValueError(
            f"The table holds '{name}' at {covered}; {wavelength_nm:g} nm is outside, and indices are not "
            f"extrapolated. Give the index at {wavelength_nm:g} nm itself."
        )
    return complex(np.interp(wavelength_nm, wavelengths, [value for _, value in entries]))
