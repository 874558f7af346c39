"""The packages that only benches with a camera need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from goniometer.errors import ConfigurationError


def camera_package(module: str) -> Any:
    """Import a package of the extra `camera`; raises ConfigurationError when it is not installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        raise ConfigurationError(
            [
                f"The rig has a camera, but the package {module} is not installed. No picture was taken. "
                "Run: pip install 'goniometer[camera]'"
            ]
        ) from None
