"""YAML that means something else than it looks like, or unpacks to more than is there."""

from __future__ import annotations

import math
import time

import pytest

from calib.errors import MaterialError
from calib.io.yaml_checks import MOST_BYTES, Place, finite_number, read_yaml


def content_of(folder, text):
    """What a file of this text holds."""
    path = folder / "food.yaml"
    path.write_text(text)
    return read_yaml(path)[1]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("90", 90),
        ("-7", -7),
        ("+7", 7),
        ("010", 10),
        ("3e5", 3e5),
        ("3.e-5", 3e-5),
        ("-.5", -0.5),
        ("1.25", 1.25),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("!!float 3", 3.0),
        ("1:30", "1:30"),
        ("1:30.5", "1:30.5"),
        ("0x1F", "0x1F"),
        ("0b11", "0b11"),
        ("0o17", "0o17"),
        ("1_000", "1_000"),
        ("9" * 31, "9" * 31),
        ("0x" + "f" * 100_000, "0x" + "f" * 100_000),
        ("1" + ":59" * 10_000, "1" + ":59" * 10_000),
    ],
)
def test_numbers_are_decimal(text, value, tmp_path):
    """What looks like a decimal number is one; hours and minutes, other bases and endless digits are text, which is no
    number for whoever needs one."""
    found = content_of(tmp_path, f"a: {text}\n")["a"]
    assert found == value and type(found) is type(value)
    if isinstance(value, str):
        with pytest.raises(MaterialError) as error:
            finite_number(Place("food.yaml"), found)
        assert len(str(error.value)) < 300 and "plain number" in str(error.value)


@pytest.mark.parametrize("text", ["!!int 0xffff", "!!int 1:30", "!!float 1:30.5", "!!int 1_0", "!!int " + "9" * 5000])
def test_tags_change_nothing(text, tmp_path):
    """A number of another kind is none with its tag either; the error has its line."""
    with pytest.raises(MaterialError, match="line 1, column 4: .* is no (whole )?number"):
        content_of(tmp_path, f"a: {text}\n")


LAUGHS = "a0: &a0 [x, x]\n" + "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12))
MERGES = "a0: &a0 {k: 1}\n" + "".join(f"a{k}: &a{k} {{<<: [{', '.join([f'*a{k - 1}'] * 9)}]}}\n" for k in range(1, 12))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LAUGHS, "line 2, .* stands for a list or mapping; write it out"),
        (MERGES, "line 2, .* stands for a list or mapping; write it out"),
        ("a:\n  <<: {b: 1}\n", "line 2, column 3: << takes keys from elsewhere; write them out"),
        ("a: {!!merge x: {b: 1}}\n", "<< takes keys from elsewhere"),
        ("a: &a [*a]\n", "stands for a list or mapping|recursive"),
        ("[" * 2000, "nested too deeply|line 1"),
    ],
)
def test_bombs_are_refused_at_once(text, words, tmp_path):
    """Lists of lists of one list, keys merged from merges, and what holds itself."""
    began = time.monotonic()
    with pytest.raises(MaterialError, match=words):
        content_of(tmp_path, text)
    assert time.monotonic() - began < 10.0, "it was unpacked"


def test_an_alias_of_a_number_is_read(tmp_path):
    """A value that stands in two places may be written once."""
    assert content_of(tmp_path, "a: &E 3e5\nb: *E\n") == {"a": 3e5, "b": 3e5}


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    """A megabyte is no list of foods."""
    with pytest.raises(MaterialError, match="at most 1 MB are read"):
        content_of(tmp_path, "#" * (MOST_BYTES + 1))


def test_what_is_read_belongs_to_the_reader(tmp_path):
    """A file is parsed once, and yet each reader may change what it got; a file that was changed is read anew."""
    text = "a: {b: 1}"
    content_of(tmp_path, text)["a"]["b"] = 2
    assert content_of(tmp_path, text) == {"a": {"b": 1}}
    assert content_of(tmp_path, text.replace("1", "3")) == {"a": {"b": 3}}
