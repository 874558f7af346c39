"""Run a polarimetric goniometer from a YAML recipe and fit the material while it scans.

The public face re-exports lazily, so that ``import goniometer`` stays cheap::

    Surface        a surface composed of reflection lobes               (model)
    SurfaceFamily  surfaces that differ in the values of parameters     (model)
    Dataset        measured values with their errors                    (model)
    fit            fit a surface model to measured values               (model)
    read           measured values out of a run, NeXus file or table    (goniometer)
    load           a run as an xarray.Dataset                           (goniometer)
    load_maps      the maps of a run with a camera as another one       (goniometer)
    run            run a recipe                                         (goniometer)
    resume         take a run up again that was cut short               (goniometer)
    simulate       serve a scene as a simulated bench                   (goniometer)
"""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path
from typing import Any

__version__ = "0.1.0"

_PARTS = ("model", "drivers", "acquisition", "sim_devices")
_PUBLIC = {
    "Surface": ("model.surface", "Surface"),
    "SurfaceFamily": ("model.fit", "SurfaceFamily"),
    "Dataset": ("model.fit", "Dataset"),
    "fit": ("model.fit", "fit"),
    "read": ("goniometer.fitting.input", "read"),
    "run": ("goniometer.run_recipe", "run"),
    "resume": ("goniometer.resume_run", "resume"),
    "simulate": ("goniometer.bench", "simulate"),
    "load": ("goniometer.labelled", "load"),
    "load_maps": ("goniometer.labelled_maps", "load_maps"),
}
__all__ = [
    "Dataset",
    "Surface",
    "SurfaceFamily",
    "__version__",
    "fit",
    "load",
    "load_maps",
    "read",
    "resume",
    "run",
    "simulate",
]


def _refuse_hidden_parts() -> None:
    """Raise ImportError when a stranger's module stands where one of our packages should.

    The packages have plain names, so a user's own ``model.py`` in the working folder would be imported in place of ours
    and fail much later, in an unrelated line.
    """
    home = Path(__file__).resolve().parent.parent
    for name in _PARTS:
        spec = importlib.util.find_spec(name)
        if spec is None:
            raise ImportError(f"goniometer's package '{name}' is not installed. Install it again from its source.")
        found = Path(spec.origin or next(iter(spec.submodule_search_locations or [""]), "")).resolve()
        if found != home / name / "__init__.py":
            raise ImportError(
                f"{found} hides goniometer's package '{name}', which is in {home / name}. "
                f"Nothing was loaded. Rename that file or folder, or start Python in another folder."
            )


_refuse_hidden_parts()


def __getattr__(name: str) -> Any:
    try:
        module, attribute = _PUBLIC[name]
    except KeyError:
        raise AttributeError(f"module 'goniometer' has no attribute '{name}'") from None
    return getattr(importlib.import_module(module), attribute)
