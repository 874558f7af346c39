"""Draws the maps of a run while they are written, and fits them behind the last one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.events import MapsMade
from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.maps.nexus_maps import write_maps
from acquisition.imaging.maps.nexus_materials import write_materials
from acquisition.imaging.maps.pixel_fits import MaterialFits
from goniometer.errors import FitError, ReductionError
from goniometer.imaging.run_maps import run_maps
from goniometer.map_drawing.files import draw_maps, draw_overview, draw_parameters
from goniometer.map_drawing.overview import chosen
from goniometer.run_folder import MeasuredRun

if TYPE_CHECKING:
    import h5py

FOLDER = "maps"
_DRAWN = ("S0", "DoLP", "DoLP_variance", "AoLP_rad")


class MapResults:
    """The maps of one run: in its NeXus file, a page for each direction, a sheet of some, and those of the material.

    Parameters
    ----------
    run : MeasuredRun
        Of a recipe with `imaging`.

    Attributes
    ----------
    written : list of Path
        The pictures so far.
    notes : list of str
        What a person should know of the maps.
    """

    def __init__(self, run: MeasuredRun) -> None:
        assert run.recipe.imaging is not None, "asked only for a recipe that makes maps"
        self._run, self._title, self._folder = run, run.recipe.recipe, run.folder / FOLDER
        self._chosen = chosen(len(run.points))
        self._shown: list[DirectionMaps] = []
        self._material: MaterialFits | None = None
        if (material := run.recipe.imaging.material) is not None:
            acceptance_sr = run.rig.calibration.acceptance_sr
            self._material = MaterialFits(run.recipe.fit, bin_px=material.bin_px, acceptance_sr=acceptance_sr)
        self._made = 0
        self.written: list[Path] = []
        self.notes: list[str] = []

    def write(self, entry: h5py.Group) -> None:
        """Make all maps and write them; what cannot be made is a note, and costs no other result.

        Parameters
        ----------
        entry : h5py.Group
            The NeXus file's NXentry.

        Raises
        ------
        JournalError
            When a file cannot be read or written.
        """
        self._folder.mkdir(exist_ok=True)
        try:
            write_maps(entry, self._drawn())
        except ReductionError as error:
            self.notes.append(f"no maps: {error}")
            return
        if self._shown:
            self.written.append(self._run.folder / "maps.png")
            draw_overview(self.written[-1], self._shown, title=self._title, of=len(self._run.points))
        if self._material is not None and self._made:
            self._fit(entry, self._material)

    def summary(self) -> MapsMade:
        """What has been made of the pictures."""
        return MapsMade(self._made, len(self._run.points), str(self._folder), tuple(self.notes))

    def _drawn(self) -> Iterator[DirectionMaps]:
        """The maps, each drawn once it has been written."""
        for place, one in enumerate(run_maps(self._run)):
            yield one
            self.written.append(self._folder / f"point_{one.point:03d}_exit_{one.exit_deg:+.2f}.png")
            draw_maps(self.written[-1], one, title=self._title)
            self._made += bool(one.maps)
            self.notes += [f"exit {one.exit_deg:.2f}°: {note}" for note in one.notes]
            if place in self._chosen:
                self._shown.append(replace(one, maps={name: one.maps[name] for name in _DRAWN if name in one.maps}))
            if self._material is not None:
                self._material.add(one)

    def _fit(self, entry: h5py.Group, material: MaterialFits) -> None:
        try:
            found = material.found()
        except FitError as error:
            self.notes.append(f"no maps of the material: {error}")
            return
        write_materials(entry, found)
        self.written.append(self._run.folder / "material.png")
        draw_parameters(self.written[-1], found, title=self._title)
        self.notes += found.notes
