"""A rig file's text with another zero of one axis, its error and its date, and all else as its author wrote it."""

from __future__ import annotations

import codecs
import shutil
from dataclasses import dataclass
from pathlib import Path

import yaml

from goniometer.errors import ConfigurationError
from goniometer.load_files import load_rig
from goniometer.rig_devices.entry import AxesEntry, Role


@dataclass(frozen=True)
class MeasuredZero:
    """The zero of an axis and its standard error in degrees, and the time that it was measured, in ISO 8601."""

    zero_deg: float
    stderr_deg: float
    measured: str

    @property
    def keys(self) -> dict[str, str]:
        """The keys of an axis that say it, and their values, as they stand in a rig file."""
        return {
            "zero_deg": f"{self.zero_deg:z.5f}",
            "zero_stderr_deg": f"{self.stderr_deg:.5f}",
            "zero_measured": f"'{self.measured}'",
        }

    def __str__(self) -> str:
        return ", ".join(f"{key}: {value}" for key, value in self.keys.items())


def store_zero(path: Path, role: Role, zero: MeasuredZero) -> None:
    """Write the zero of an axis into a rig file; the file is there whole, old or new, at every moment.

    Raises
    ------
    ConfigurationError
        When the file cannot be written, or would mean anything but the new zero; it was left as it is.
    """
    path = path.resolve()
    content = path.read_bytes()
    text = content.decode("utf-8-sig")
    mark = codecs.BOM_UTF8 if content.startswith(codecs.BOM_UTF8) else b""
    part = path.with_name(f"{path.name}.part")
    try:
        part.write_bytes(mark + with_zero(text, role, zero).encode())
        shutil.copymode(path, part)
        _require_only(path, part, role, zero)
        part.replace(path)
    except OSError as error:
        raise ConfigurationError(
            [f"{path} cannot be written: {error.strerror}. Write these keys of {role} yourself: {zero}"]
        ) from error
    finally:
        part.unlink(missing_ok=True)


def with_zero(text: str, role: Role, zero: MeasuredZero) -> str:
    """The text of a valid rig file with another zero of one axis; comments stay."""
    for key, value in reversed(zero.keys.items()):
        text = _with_key(text, role, key, value)
    return text


def _with_key(text: str, role: Role, key: str, value: str) -> str:
    axis = _axis(text, role)
    for there, old in axis.value:
        if there.value == key:
            return f"{text[: there.start_mark.index]}{key}: {value}{text[old.end_mark.index :]}"
    first = axis.value[0][0].start_mark
    between = ", " if axis.flow_style else f"{_line_end(text)}{' ' * first.column}"
    return f"{text[: first.index]}{key}: {value}{between}{text[first.index :]}"


def _axis(text: str, role: Role) -> yaml.MappingNode:
    """The keys of the axis in a role, wherever its device stands."""
    for _, device in _under(yaml.compose(text, Loader=yaml.SafeLoader), "devices").value:
        for key, axes in device.value:
            if key.value == "axes" and any(name.value == role for name, _ in axes.value):
                return _under(axes, role)
    raise AssertionError(f"a rig that was accepted has the axis {role}")


def _under(node: yaml.Node | None, key: str) -> yaml.MappingNode:
    assert isinstance(node, yaml.MappingNode), "a rig that was accepted has keys here"
    found = next(value for name, value in node.value if name.value == key)
    assert isinstance(found, yaml.MappingNode), "a rig that was accepted has keys here"
    return found


def _line_end(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _require_only(path: Path, part: Path, role: Role, zero: MeasuredZero) -> None:
    """Raise ConfigurationError unless the new file means the old one with the new zero."""
    old, new = load_rig(path).model_dump(), load_rig(part)
    for name, device in load_rig(path).devices.items():
        if isinstance(device, AxesEntry) and role in device.axes:
            old["devices"][name]["axes"][role] |= {key: yaml.safe_load(value) for key, value in zero.keys.items()}
    if new.model_dump() != old:
        raise ConfigurationError(
            [f"{path} is written in a way that only a person can change. Write these keys of {role}: {zero}"]
        )
