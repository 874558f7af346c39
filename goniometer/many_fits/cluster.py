"""Fit many inputs on a Dask cluster."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

from goniometer import __version__
from goniometer.errors import ConfigurationError, GoniometerError
from goniometer.many_fits.row import Asked, Row, crashed, fit_row

_CONNECTED_WITHIN_S = 20
# Given any other, Dask says what is wrong, but then waits for most of a minute.
_ADDRESS = re.compile(r"(tcp|tls)://[^/\s]+:\d{1,5}")


def fitted_on(scheduler: str, paths: Iterable[Path], asked: Asked) -> Iterator[tuple[Path, Row]]:
    """Inputs with what became of them, as they are done.

    What a worker had under way when it died, the scheduler gives to another.

    Parameters
    ----------
    scheduler : str
        Its address, for example tcp://127.0.0.1:8786.
    paths : iterable of Path
        The inputs, which every worker must see under the same absolute path.
    asked : Asked
        What to fit.

    Raises
    ------
    ConfigurationError
        If the address is none, Dask is not installed here, or this program not on the workers.
    GoniometerError
        If the scheduler cannot be reached, has no worker, or is lost.
    """
    if not _ADDRESS.fullmatch(scheduler):
        raise ConfigurationError(
            [f"--scheduler is '{scheduler}'; write tcp://HOST:PORT, as `dask scheduler` says it. Nothing was fitted."]
        )
    try:
        from distributed import Client, Security, as_completed
    except ImportError as error:
        raise ConfigurationError(
            [
                "--scheduler needs Dask, which is not installed. Nothing was fitted. "
                "Run: pip install 'goniometer[distributed]', or leave --scheduler out."
            ]
        ) from error
    if scheduler.startswith("tls") and Security().get_connection_args("client")["ssl_context"] is None:
        raise ConfigurationError(
            [
                f"--scheduler is {scheduler}, but Dask has no certificates here. Nothing was fitted. Name them in its "
                "configuration (distributed.comm.tls)."
            ]
        )
    try:
        client = Client(scheduler, timeout=_CONNECTED_WITHIN_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise GoniometerError(
            f"The Dask scheduler {scheduler} cannot be reached: {error}. Nothing was fitted. Check the address, and "
            "that `dask scheduler` runs there."
        ) from error
    with client:
        _require_workers(client, scheduler)
        asked = Asked(asked.recipe and asked.recipe.absolute(), dict(asked.changes))
        own = uuid4().hex  # the same name would give another run's result
        futures = {
            client.submit(fit_row, path.absolute(), asked, key=f"fit-{own}-{number}"): path
            for number, path in enumerate(paths)
        }
        for future in as_completed(futures, loop=client.loop):
            if future.cancelled():
                raise GoniometerError(f"The Dask scheduler {scheduler} is gone. What is done is stored.")
            fault = future.exception() if future.status == "error" else None
            row = future.result() if fault is None else crashed(f"{type(fault).__name__}: {fault}")
            yield futures.pop(future), row


def _require_workers(client: Any, scheduler: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_CONNECTED_WITHIN_S)
    except TimeoutError as error:
        raise GoniometerError(
            f"The Dask scheduler {scheduler} has no workers. Nothing was fitted. Start some: dask worker {scheduler}"
        ) from error
    versions = client.run(_version, on_error="return")
    strange = {worker: found for worker, found in versions.items() if found != __version__}
    if strange:
        worker, found = next(iter(strange.items()))
        raise ConfigurationError(
            [
                f"{len(strange)} of {len(versions)} Dask workers do not have goniometer {__version__}; {worker} says: "
                f"{found}. Nothing was fitted. Install the same version on all of them."
            ]
        )


def _version() -> str:
    return __version__
