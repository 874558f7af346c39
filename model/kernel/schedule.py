"""The order in which a kernel computes: what is the same for all directions first, what few need only if one does."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

from model.kernel.expression import Symbol, reachable

_OUTSIDE = -1


@dataclass(frozen=True)
class Block:
    """Guarded expressions of one truth, and all that only they need, in order."""

    mask: Symbol
    body: list[Symbol]
    results: list[Symbol] = field(default_factory=list)


@dataclass(frozen=True)
class Schedule:
    """What to compute once, and what for every few directions: expressions and blocks, in order."""

    once: list[Symbol]
    each: list[Symbol | Block]


def schedule(outputs: Sequence[Symbol], uniform: Collection[str]) -> Schedule:
    """Order the expressions that outputs need.

    Parameters
    ----------
    outputs : sequence of Symbol
        What the kernel returns.
    uniform : collection of str
        Inputs that are the same for all directions.
    """
    symbols = reachable(outputs)
    constant = _constant_over_directions(symbols, uniform)
    groups: dict[int, list[Symbol]] = defaultdict(list)
    for symbol in symbols:
        if symbol.operation == "guarded" and symbol.serial not in constant:
            groups[symbol.arguments[0].serial].append(symbol)
    places = _places(symbols, outputs, constant)
    blocks = {mask: Block(results[0].arguments[0], places[mask], results) for mask, results in groups.items()}
    return Schedule(
        once=[symbol for symbol in symbols if symbol.serial in constant],
        each=list(_ordered(outputs, blocks, constant)),
    )


def _constant_over_directions(symbols: Sequence[Symbol], uniform: Collection[str]) -> set[int]:
    constant: set[int] = set()
    for symbol in symbols:
        fixed = symbol.detail in uniform if symbol.operation == "input" else symbol.operation != "constant"
        if fixed and all(a.serial in constant or a.operation == "constant" for a in symbol.arguments):
            constant.add(symbol.serial)
    return constant


def _places(symbols: Sequence[Symbol], outputs: Sequence[Symbol], constant: Collection[int]) -> dict[int, list[Symbol]]:
    # What only one block needs is computed in it; what more than one or the world outside needs, outside.
    users: dict[int, set[int]] = defaultdict(set)
    for output in outputs:
        users[output.serial].add(_OUTSIDE)
    places: dict[int, list[Symbol]] = defaultdict(list)
    for symbol in reversed(symbols):
        if symbol.serial in constant:
            continue
        by = users[symbol.serial]
        if symbol.operation == "guarded":
            # The block itself, and the truth that opens it, are outside of all blocks.
            mask, value = symbol.arguments
            users[mask.serial].add(_OUTSIDE)
            users[value.serial].add(mask.serial)
            continue
        if len(by) == 1 and _OUTSIDE not in by:
            places[next(iter(by))].insert(0, symbol)
        for argument in symbol.arguments:
            users[argument.serial] |= by
    return places


def _ordered(
    outputs: Sequence[Symbol], blocks: dict[int, Block], constant: Collection[int]
) -> Iterator[Symbol | Block]:
    done: set[int] = set(constant)
    finished: set[int] = set()
    stack: list[Symbol] = list(reversed(outputs))
    while stack:
        symbol = stack[-1]
        block = blocks.get(symbol.arguments[0].serial) if symbol.operation == "guarded" else None
        if symbol.serial in done or (block and block.mask.serial in finished):
            done.add(symbol.serial)
            stack.pop()
            continue
        waiting = [need for need in _needs(symbol, block) if need.serial not in done and not _is_result(need, finished)]
        if waiting:
            stack.extend(reversed(waiting))
            continue
        stack.pop()
        done.add(symbol.serial)
        if block is None:
            yield symbol
        else:
            finished.add(block.mask.serial)
            yield block


def _needs(symbol: Symbol, block: Block | None) -> list[Symbol]:
    if block is None:
        return list(symbol.arguments)
    inside = {s.serial for s in block.body}
    values = [result.arguments[1] for result in block.results]
    outer = [argument for s in block.body for argument in s.arguments if argument.serial not in inside]
    return [block.mask, *(v for v in values if v.serial not in inside), *outer]


def _is_result(symbol: Symbol, finished: Collection[int]) -> bool:
    return symbol.operation == "guarded" and symbol.arguments[0].serial in finished
