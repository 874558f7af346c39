"""``goniometer fit`` with many inputs: a table of fits, in the inputs' order, that a later run goes on with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TextIO, cast

from goniometer.errors import ConfigurationError, GoniometerError
from goniometer.fitting.input import choice_from
from goniometer.lasting_stream import LastingStream
from goniometer.many_fits.cluster import fitted_on
from goniometer.many_fits.progress_file import Input, ProgressFile
from goniometer.many_fits.row import CRASHED, OK, REFUSED, UNREADABLE, Asked, Row
from goniometer.many_fits.table import require_table, write_table
from goniometer.many_fits.workers import cores, fitted_here

_TOLD = 5


@dataclass(frozen=True)
class ManyFitted:
    """What became of many inputs: how many of each status, and the first that were not fitted."""

    out: Path
    counts: Counter[str]
    troubles: tuple[str, ...]

    @property
    def all_fitted(self) -> bool:
        """Whether every input was fitted."""
        return set(self.counts) <= {OK}

    def __str__(self) -> str:
        told = {OK: "fitted", REFUSED: "refused", UNREADABLE: "unreadable", CRASHED: "crashed"}
        counts = ", ".join(f"{self.counts[status]} {word}" for status, word in told.items() if self.counts[status])
        return "\n".join([f"{self.counts.total()} inputs: {counts}. The table is {self.out}", *self.troubles])


def fit_files(
    paths: Sequence[Path],
    out: Path,
    asked: Asked,
    terminal: TextIO,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
) -> ManyFitted:
    """Fit many inputs, and write a table with one row for each.

    Every fit is stored as soon as it is done, in a file beside the table. The table is written when all are done.

    Parameters
    ----------
    paths : sequence of Path
        Runs, NeXus files and tables. What is named twice is fitted once, and has two rows. The table of an earlier run
        and what is stored beside it, which a glob may find, are left out.
    out : Path
        The table, a .csv or .parquet file; what stands there may only be the table of an earlier run.
    asked : Asked
        What to fit.
    terminal : text stream
        Shows the progress, if it is a terminal.
    workers : int, optional
        How many processes; as many as there are cores by default.
    scheduler : str, optional
        Address of a Dask scheduler whose workers are to do it.
    resume : bool
        Whether inputs that an earlier run has stored, and that have not changed since, are left as they are.

    Raises
    ------
    ConfigurationError
        If the recipe or the name of the table cannot be used, an earlier run left fits and `resume` is not asked, or
        there is no input.
    GoniometerError
        If the cluster cannot be used, or a file not be written.
    """
    require_table(out)
    if asked.recipe is not None:
        choice_from(asked.recipe)
    kept = out.with_name(out.name + ".done.jsonl")
    if not resume and kept.exists() and kept.stat().st_size:
        raise ConfigurationError(
            [
                f"{kept} holds fits of an earlier run. Nothing was fitted. Go on with that run by --resume, or remove "
                "the file to begin anew."
            ]
        )
    paths = _without(paths, (out, kept), terminal)
    inputs = {path: Input.now(path) for path in paths}
    done = ProgressFile(kept, asked)
    rows = _stored(done, inputs)
    left = [path for path in inputs if path not in rows]
    try:
        with done, _progress(terminal, len(rows), len(inputs)) as advance:
            for path, row in _fitted(left, asked, workers, scheduler):
                done.keep(inputs[path], row)
                rows[path] = row
                advance()
    except (GoniometerError, KeyboardInterrupt) as error:
        with ProgressFile(kept, asked) as stored:
            count = len(_stored(stored, inputs))
        how = f"{count} of {len(inputs)} inputs are done, and stored in {kept}. Go on with --resume."
        if isinstance(error, KeyboardInterrupt):
            print(how, file=terminal)  # nobody shows its notes
        elif count:
            error.add_note(how)
        if not kept.stat().st_size:
            kept.unlink()
        raise
    pairs = [(path, rows[path]) for path in paths]
    write_table(out, pairs)
    return ManyFitted(out, Counter(row["status"] for _, row in pairs), tuple(_troubles(pairs)))


def _without(paths: Sequence[Path], own: Sequence[Path], terminal: TextIO) -> list[Path]:
    """Inputs less the files that this command writes."""
    written = {path.resolve() for path in own}
    inputs = [path for path in paths if path.resolve() not in written]
    left_out = list(dict.fromkeys(str(path) for path in paths if path.resolve() in written))
    if left_out:
        print(f"{' and '.join(left_out)}: left out, for it is what this command writes.", file=terminal)
    if not inputs:
        raise ConfigurationError(["No input is left. Nothing was fitted. Name runs, NeXus files or tables."])
    if len(set(inputs)) < len(inputs):
        print(f"{len(inputs) - len(set(inputs))} inputs are named again; each is fitted once.", file=terminal)
    return inputs


def _stored(done: ProgressFile, inputs: Mapping[Path, Input]) -> dict[Path, Row]:
    return {path: row for path, given in inputs.items() if (row := done.row(given)) is not None}


def _fitted(
    paths: Sequence[Path], asked: Asked, workers: int | None, scheduler: str | None
) -> Iterator[tuple[Path, Row]]:
    if not paths:
        return iter(())
    if scheduler is not None:
        return fitted_on(scheduler, paths, asked)
    return fitted_here(paths, asked, min(workers or cores(), len(paths)))


@contextmanager
def _progress(terminal: TextIO, done: int, total: int) -> Iterator[Callable[[], None]]:
    """A progress bar where there is a terminal, and what counts on by one."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    stream = LastingStream(terminal)
    columns = (TextColumn("fitting"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(file=cast(IO[str], stream))
    with Progress(*columns, console=console, disable=not stream.isatty(), transient=True) as bar:
        task = bar.add_task("", total=total, completed=done)
        yield lambda: bar.advance(task)


def _troubles(rows: Sequence[tuple[Path, Row]]) -> Iterator[str]:
    lost = [(path, row) for path, row in rows if row["status"] != OK]
    for path, row in lost[:_TOLD]:
        yield f"  {path}: {row['status']}: {row['message']}"
    if len(lost) > _TOLD:
        yield f"  … and {len(lost) - _TOLD} more, of which the table's column `message` says why"
