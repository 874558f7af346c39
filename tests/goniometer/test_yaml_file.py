from __future__ import annotations

from pathlib import Path

import pytest

from goniometer.yaml_file import YamlFile, read_yaml


@pytest.fixture
def read(tmp_path: Path):
    def read_content(content: str | bytes) -> YamlFile:
        path = tmp_path / "file.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_yaml(path)

    return read_content


def faults(file: YamlFile) -> list[tuple[int | None, str]]:
    return [(fault.line, fault.text) for fault in file.faults]


def test_every_key_and_value_keeps_its_line(read) -> None:
    file = read("# comment\na: 1\nb:\n  c: {d: 2,\n      e: 3}\n  f:\n  - 4\n  - g: 5\n  h:\n    text\n")
    assert file.data == {"a": 1, "b": {"c": {"d": 2, "e": 3}, "f": [4, {"g": 5}], "h": "text"}}
    assert file.lines == {
        (): 2,
        ("a",): 2,
        ("b",): 3,
        ("b", "c"): 4,
        ("b", "c", "d"): 4,
        ("b", "c", "e"): 5,
        ("b", "f"): 6,
        ("b", "f", 0): 7,
        ("b", "f", 1): 8,
        ("b", "f", 1, "g"): 8,
        ("b", "h"): 10,
    }
    assert not file.faults


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("1", 1),
        ("-12", -12),
        ("+3", 3),
        ("0", 0),
        ("1.5", 1.5),
        ("1.", 1.0),
        (".5", 0.5),
        ("-1.0e-3", -1.0e-3),
        ("2.5E+10", 2.5e10),
        ("true", True),
        ("False", False),
        ("iron", "iron"),
        ("'1e-3'", "1e-3"),
        ('"on"', "on"),
        ("'12:30'", "12:30"),
        ("../rigs/a.yaml", "../rigs/a.yaml"),
        ("socket://127.0.0.1:5000", "socket://127.0.0.1:5000"),
        ("COM3", "COM3"),
        ("60°", "60°"),
    ],
)
def test_values_are_read_as_written(read, written: str, value: object) -> None:
    file = read(f"key: {written}\n")
    assert not file.faults
    assert file.data == {"key": value}
    assert type(file.data["key"]) is type(value)


@pytest.mark.parametrize(
    ("written", "part"),
    [
        ("1e-3", "Write 1.0e-3"),
        ("1E5", "Write 1.0e+5"),
        ("1.5e5", "Write 1.5e+5"),
        ("-2e+3", "Write -2.0e+3"),
        ("08", "text, not as a number. Write 8"),
        ("007", "octal"),
        ("0o17", None),
        ("0x1F", "decimal digits"),
        ("0b11", "decimal digits"),
        ("1_000", "decimal digits"),
        ("1_000.5", "without '_'"),
        ("9" * 5000, "at most 18 decimal digits"),
        ("12:30", "750 (base 60)"),
        ("1:30.5", "base 60"),
        (".inf", "no finite number"),
        ("-.INF", "no finite number"),
        (".nan", "no finite number"),
        ("nan", "no finite number"),
        ("Infinity", "no finite number"),
        ("1e999", "no finite number"),
        ("1.0e+999", "no finite number"),
        ("yes", "YAML reads as true"),
        ("No", "YAML reads as false"),
        ("ON", "YAML reads as true"),
        ("off", "YAML reads as false"),
        ("~", "has no value"),
        ("null", "has no value"),
        ("", "has no value"),
        ("2026-05-09", "a date"),
        ("2026-05-09 12:00:00", "a date"),
        ("0,03", "Write it with a point: 0.03"),
        ("=", "special meaning"),
        ('"\\ud800"', "halves of characters"),
        ("!!str 5", "tags are not read"),
        ("!!python/name:os.system ''", "tags are not read"),
        ("!custom {a: 1}", "has the tag !custom"),
        ("*nowhere", "aliases are not read"),
    ],
)
def test_values_that_would_become_something_else_are_refused(read, written: str, part: str | None) -> None:
    file = read(f"first: 1\nkey: {written}\nlast: 2\n")
    if part is None:
        assert not file.faults
        return
    assert len(file.faults) == 1
    assert str(file.faults[0]).startswith(f"{file.path}:2: key 'key': ")
    assert part in file.faults[0].text
    assert file.data["first"] == 1
    assert file.data["last"] == 2
    assert file.unread == {("key",)}


def test_a_file_that_would_unfold_without_end_is_refused_at_once(read) -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 30)]
    file = read("\n".join(lines))
    assert len(file.faults) == 290


def test_a_group_that_holds_itself_is_refused(read) -> None:
    assert faults(read("a: &a {b: *a}\n")) == [
        (1, "key 'a.b': is the alias *a; aliases are not read. Write the value out in full")
    ]


@pytest.mark.parametrize("nested", ["[" * 100_000, "{a: " * 50_000, "- " * 50_000, "a: " + "[" * 30 + "]" * 30])
def test_deep_nesting_is_refused(read, nested: str) -> None:
    ((line, text),) = faults(read(nested))
    assert line == 1
    assert "nested more than 20 deep" in text or "not YAML" in text


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"", (1, "is empty. Write keys and values, for example 'rig: name'")),
        (b"# only a comment\n\n", (1, "is empty. Write keys and values, for example 'rig: name'")),
        (b"--- \n", (1, "is empty. Write keys and values, for example 'rig: name'")),
        (b"# text\njust text\n", (2, "does not begin with a key. Write keys and values, for example 'rig: name'")),
        (b"a: 1\nb: \xe4\n", (2, "is not UTF-8 text. Save the file with the encoding UTF-8")),
        ("a: 1\n".encode("utf-16"), (1, "is not UTF-8 text. Save the file with the encoding UTF-8")),
        (b"a: 1\nb: 2\x00\n", (2, "the control character U+0000 stands here. Remove it")),
        (b"a: 1\n---\nb: 2\n", (2, "a second document begins here ('---'). Write one document a file")),
        (
            b"a: 1\n? [b, c]\n: 2\n",
            (2, "one of its keys is a list or a group of keys; allowed: words and whole numbers"),
        ),
        (b"a: 1\n1.5: 2\n", (2, "one of its keys is 1.5; allowed: words and whole numbers")),
        (b"%YAML 9.0\n---\na: 1\n", (1, "not YAML: found incompatible YAML document (version 1.* is required)")),
    ],
)
def test_a_file_that_is_no_yaml_of_keys_and_values(read, content: bytes, fault: tuple[int, str]) -> None:
    assert faults(read(content)) == [fault]


def test_a_byte_order_mark_and_windows_line_ends_are_read(read) -> None:
    file = read(b"\xef\xbb\xbfa: 1\r\nb: 2\r\n")
    assert (file.data, faults(file), file.lines["b",]) == ({"a": 1, "b": 2}, [], 2)
    assert file.text.startswith("a: 1")


def test_every_duplicate_is_named_and_the_first_value_kept(read) -> None:
    file = read("a: 1\nb: {c: 1, c: 2}\na: 3\na: 4\n")
    assert file.data == {"a": 1, "b": {"c": 1}}
    assert faults(file) == [
        (2, "key 'b.c': stands twice, first on line 2. Remove one of the two"),
        (3, "key 'a': stands twice, first on line 1. Remove one of the two"),
        (4, "key 'a': stands twice, first on line 1. Remove one of the two"),
    ]


def test_a_tab_is_refused_except_in_text_and_comments(read) -> None:
    assert not read('a: "x\ty" # a tab in text\tand in a comment\nb: 2\n').faults
    assert [line for line, _ in faults(read("a:\n\tb: 1\n \tc: 2\nd: 3\n"))] == [2, 3]


def test_a_missing_file_a_folder_and_a_huge_file_are_refused_by_name(tmp_path: Path, read) -> None:
    missing, folder = read_yaml(tmp_path / "none.yaml"), read_yaml(tmp_path)
    assert str(missing.faults[0]).startswith(f"{tmp_path / 'none.yaml'}: does not exist. Check the name")
    assert str(folder.faults[0]) == f"{tmp_path}: is not a file but a folder or a device. Write the name of a YAML file"
    assert faults(read(b"a: 1\n" + b"#" * 1_000_000)) == [
        (
            None,
            "is larger than 1000000 bytes, which no file of this kind is. A long list of directions belongs in a table "
            "beside the recipe (points_file)",
        )
    ]
    assert missing.data is folder.data is None


def test_a_long_file_is_read_as_a_short_one_is(read) -> None:
    """It is read by another loader: what it holds, its lines and its faults are the same."""
    long = "# " + "-" * 30_000 + "\n"
    for content in (
        "a: 1\nb: [1, 2.5, on,\n  'x']\nc: {d: ~, e: [1, {f: 2}]}\n",
        "a: &x 1\nb: *x\nc: !!int 3\na: 2\n",
        "a: [1, 2\nb: 3\n",
        "a: 1\n---\nb: 2\n",
        "a: " + "[" * 30 + "]" * 30 + "\n",
    ):
        short, other = read("# -\n" + content), read(long + content)
        assert (other.data, other.lines, faults(other)) == (short.data, short.lines, faults(short))
        assert other.unread == short.unread
