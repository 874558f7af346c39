"""What a YAML syntax error means, in plain words."""

from __future__ import annotations

from collections.abc import Iterator

import yaml

_TAB = "a tab stands here, which YAML does not allow. Use spaces"

_MEANINGS = {
    "mapping values are not allowed here": (
        "a second colon stands on this line, the line above has none, or the indentation differs. Put text that holds "
        "a colon in quotes"
    ),
    "could not find expected ':'": "a key without a colon. Write 'key: value'",
    "expected <block end>": "this line is indented differently from the lines above, or a bracket or quote is too many",
    "expected ',' or '}'": "a comma is missing, or the bracket { is not closed",
    "expected ',' or ']'": "a comma is missing, or the bracket [ is not closed",
    "expected the node content": "a value is missing, or a bracket or comma is too many",
    "found unexpected end of stream": "a quotation mark is not closed before the end of the file",
    "found unexpected document separator": "a quotation mark is not closed before '---' or '...'",
    "expected '<document start>'": "this line does not belong to the keys above it. Check its indentation and brackets",
    "sequence entries are not allowed here": "a list item '- ' may not begin here. Put it on a line of its own",
    "block sequence entries are not allowed": "a list item '- ' may not begin here. Put it on a line of its own",
    "found unknown escape character": "a backslash in double quotes. Use single quotes, or write it twice",
    "too deep": "brackets or keys are nested more than 20 deep, which no file of this kind is",
}


def lines_indented_with_tabs(text: str) -> Iterator[tuple[int, str]]:
    """All lines that a tab indents, with what to do."""
    for number, line in enumerate(text.split("\n"), start=1):
        content = line.lstrip()
        if content and "\t" in line[: len(line) - len(content)]:
            yield number, _TAB


def explain_syntax(error: yaml.MarkedYAMLError) -> tuple[int, str]:
    """Line and plain words of a syntax error that PyYAML raised."""
    mark = error.problem_mark or error.context_mark
    problem = error.problem or error.context or "this is not YAML"
    if "cannot start any token" in problem:
        character = problem.partition("'")[2].rpartition("'")[0]
        words = _TAB if character == r"\t" else f"a value may not begin with {character}. Put it in quotes"
    else:
        words = next((meaning for start, meaning in _MEANINGS.items() if problem.startswith(start)), problem)
    if ("is not closed" in words or "without a colon" in words) and error.context_mark is not None:
        # What is not ended is noticed later; where it began is where a person must look.
        mark = error.context_mark
    return (mark.line + 1 if mark else 1), f"not YAML: {words}"


def explain_character(error: yaml.reader.ReaderError, text: str) -> tuple[int, str]:
    """Line and plain words of a character that YAML does not allow."""
    line = text.count("\n", 0, error.position) + 1
    return line, f"the control character U+{ord(text[error.position]):04X} stands here. Remove it"
