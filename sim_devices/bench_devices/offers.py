"""What other packages bring by entry point, and why some of it cannot be used."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable, Iterator
from importlib.metadata import entry_points
from typing import TypeVar, get_args

from pydantic import BaseModel

Kind = TypeVar("Kind", bound=BaseModel)

_log = logging.getLogger(__name__)


def offers(group: str, base: type[Kind], what: str, fault_of: Callable[[type[Kind]], str]) -> Iterator[type[Kind]]:
    """The classes that other packages name in an entry point group, one by one.

    One that cannot be used is left out with a warning, and stops nobody else.

    Parameters
    ----------
    group : str
        The entry point group.
    base : type
        What each class must be a kind of, with no method left abstract.
    what : str
        What such a class stands for, in one word.
    fault_of : callable
        Why a class cannot be used all the same; empty when it can.
    """
    for point in entry_points(group=group):
        try:
            kind = point.load()
            fault = _class_fault(kind, base) or fault_of(kind)
        except Exception as error:  # noqa: BLE001 (whatever another package does as it is loaded)
            fault = f"cannot be loaded ({error!r})"
        if fault:
            package = point.dist.name if point.dist else point.value
            _log.warning(
                "the package %s offers the %s %s, which %s. It is left out: repair or uninstall it.",
                package,
                what,
                point.name,
                fault,
            )
        else:
            yield kind


def names_of(kind: type[BaseModel], field: str) -> tuple[str, ...]:
    """The values that a field of a class may have by its Literal type; one, where it names the class in a file."""
    return tuple(str(name) for name in get_args(kind.model_fields[field].annotation))


def _class_fault(kind: object, base: type[BaseModel]) -> str:
    if not (isinstance(kind, type) and issubclass(kind, base)):
        return f"is {kind!r} and no {base.__name__}"
    if inspect.isabstract(kind):
        return f"is {kind!r} and lacks {', '.join(sorted(kind.__abstractmethods__))}"
    return ""
