"""A recipe's table of directions, read from the file beside it."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from acquisition.point_table import point_table
from goniometer.whole_recipe import WholeRecipe
from goniometer.yaml_file import UNREAD, Fault

MOST_TABLE_BYTES = 50_000_000
"""A million directions take less."""


def with_table(whole: WholeRecipe) -> WholeRecipe:
    """The directions of its points_file in place of the file's name, in the data and in the text.

    Faults in the table are reported at its own lines.
    """
    assert whole.data is not None, "it names a table"
    name = whole.data["points_file"]
    if not isinstance(name, str) or not name or "\0" in name or "points" in whole.data:
        return whole
    path = Path(os.path.normpath(whole.path.parent / name))
    content, why = _read(path)
    faults = [whole.fault(("points_file",), f"{path} {why}")] if why else []
    faults += [Fault(str(path), line, what) for line, what in (() if why else point_table(content).faults)]
    rows = [line.strip() for line in content.splitlines() if line.strip() and not line.strip().startswith("#")]
    data = {key: value for key, value in whole.data.items() if key != "points_file"}
    data["points"] = UNREAD if faults else "".join(f"{row}\n" for row in rows)
    block = f"# {path.name}\npoints: |\n" + "".join(f"  {row}\n" for row in rows)
    return replace(
        whole,
        data=data,
        text=whole.text + block,
        faults=(*whole.faults, *faults),
        unread=whole.unread | {("points",)} if faults else whole.unread,
        table=path,
    )


def _read(path: Path) -> tuple[str, str]:
    """The text of a table, or why there is none."""
    try:
        if not path.exists():
            return "", "does not exist. Check the name; in a file, a relative path starts at that file's folder"
        if not path.is_file():
            return "", "is not a file but a folder or a device. Write the name of a table"
        with path.open("rb") as stream:
            content = stream.read(MOST_TABLE_BYTES + 1)
        if len(content) > MOST_TABLE_BYTES:
            return "", f"is larger than {MOST_TABLE_BYTES} bytes, which no table of directions is"
        return content.decode("utf-8-sig"), ""
    except UnicodeDecodeError:
        return "", "is not UTF-8 text. Save the table as text, comma-separated, with the encoding UTF-8"
    except OSError as error:
        return "", f"cannot be read: {error.strerror or error}"
