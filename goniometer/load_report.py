"""Reads and validates the files a user wrote, and collects what is wrong with them into one report."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from goniometer.errors import ConfigurationError
from goniometer.faults import model_faults
from goniometer.recipe_includes import whole_recipe
from goniometer.schema import MODELS, Kind
from goniometer.yaml_file import Fault, YamlFile, read_yaml

Model = TypeVar("Model", bound=BaseModel)


def likeness(file: YamlFile) -> Kind:
    """Which kind of file the keys at its top are those of."""
    keys = set(file.data or {})
    return max(MODELS, key=lambda kind: len(keys & set(MODELS[kind].model_fields)))


class Report:
    """Reads and validates files, and collects what is wrong with them."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def read(self, path: Path, kind: Kind) -> YamlFile:
        """Read a file that the caller names; raises ConfigurationError when it is one of another kind."""
        file = read_yaml(path)
        if file.data and not file.faults and (other := likeness(file)) != kind:
            raise ConfigurationError([str(file.fault((), f"this is a {other}, and a {kind} is needed here"))])
        self.faults += file.faults
        return file

    def whole(self, file: YamlFile) -> YamlFile:
        """A recipe with all that it includes."""
        whole = whole_recipe(file)
        self.faults += whole.faults[len(file.faults) :]
        return whole

    def read_named(self, file: YamlFile, key: str) -> YamlFile | None:
        """Read the file that another one names; without a usable name there is none."""
        name = (file.data or {}).get(key)
        if not isinstance(name, str) or not name:
            return None
        try:
            path = (file.path.parent / name).resolve()
        except (OSError, ValueError, RuntimeError):
            self.faults.append(file.fault((key,), f"got {name!r}, which cannot be the name of a file"))
            return None
        if path.is_relative_to(Path.cwd()):
            path = path.relative_to(Path.cwd())
        named_file = read_yaml(path)
        for fault in named_file.faults:
            is_unreadable = fault.line is None
            self.faults.append(file.fault((key,), f"{path} {fault.text}") if is_unreadable else fault)
        return named_file

    def validated(self, file: YamlFile | None, model: type[Model]) -> Model | None:
        """Validate a file's data, where there is any."""
        if file is None or file.data is None:
            return None
        try:
            return model.model_validate(file.data)
        except ValidationError as error:
            kind = next(kind for kind, candidate in MODELS.items() if candidate is model)
            self.faults += model_faults(error, file, kind)
            return None

    def error(self) -> ConfigurationError:
        """All faults as one error, sorted by file and line."""
        ordered = sorted(set(self.faults), key=lambda fault: (fault.file, fault.line or 0, fault.text))
        return ConfigurationError([str(fault) for fault in ordered])
