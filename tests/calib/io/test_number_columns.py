"""Long CSV files: the numbers that a short one has, in a part of the memory, and errors with their row."""

from __future__ import annotations

import numpy as np
import pytest

from calib.errors import TraceError
from calib.formats import reader
from calib.formats.reader import read_table
from calib.io import number_columns as module
from calib.trace.trace import read_trace

N = 60
TIME, LOAD = 0.01 * np.arange(N), 2.0 + np.maximum(0.0, np.arange(N) - 10.0) / 7
ROWS = [f"{t!r},{f!r},{k},a{k}" for k, (t, f) in enumerate(zip(TIME.tolist(), LOAD.tolist(), strict=True))]
HEADS = {
    "plain": "time_s,force_N,count,mark\n",
    "words above": "Specimen,7\nOperator,X\n\ntime_s,force_N,count,mark\n",
    "comments": "# label: reconstructed\n# more\ntime_s,force_N,count,mark\n",
    "units row": "time,force,count,mark\ns,N,-,-\n",
}


def make_long(monkeypatch):
    """Let every file be a long one, of several pieces."""
    monkeypatch.setattr(reader, "LONG_BYTES", 0)
    monkeypatch.setattr(reader, "HEAD_BYTES", 500)
    monkeypatch.setattr(module, "CHUNK_ROWS", 17)


@pytest.fixture
def long(monkeypatch):
    """Every file is long."""
    make_long(monkeypatch)


def written(folder, text, encoding="utf-8"):
    """A file of this text."""
    path = folder / "cut.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize("layout", ["comma", "semicolon", "tab", "decimal comma", "CRLF"])
def test_a_long_file_is_read_as_a_short_one(head, layout, tmp_path, monkeypatch):
    """The same numbers bit for bit, rows, units, label and notes; text is left out."""
    text = HEADS[head] + "\n".join(ROWS) + "\n"
    if head == "words above":  # which are told from a damaged table by numbers alone below
        text = text.replace(",a", ",1")
    if layout == "decimal comma":
        text = text.replace(",", ";").replace(".", ",")
    text = text.replace(",", {"semicolon": ";", "tab": "\t"}.get(layout, ",")).replace(
        "\n", "\r\n" if layout == "CRLF" else "\n"
    )
    path = written(tmp_path, text)
    short, trace = read_table(path), read_trace(path)
    make_long(monkeypatch)
    found, again = read_table(path), read_trace(path)
    if head != "words above":
        assert set(short.columns) - set(found.columns) == {"mark"} and "'a0' is not a number" in found.left_out["mark"]
    assert list(found.rows) == list(short.rows)
    assert (found.units, found.label, found.notes, found.sha256) == (
        short.units,
        short.label,
        short.notes,
        short.sha256,
    )
    assert np.array_equal(again.time, trace.time) and np.array_equal(again.force, trace.force)
    assert again.columns == trace.columns


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("0.45,abc,45,a", "row 47"),
        ("0.45,1_0,45,a", "row 47"),
        ("0.45,nan,45,a", "row 47"),
        ("0.45,inf,45,a", "row 47"),
        ("0.45,1,45,a,7", "row 47: 5 cells, the header has 4"),
    ],
)
def test_a_bad_cell_is_named(row, words, long, tmp_path):
    """A word, or no finite number in the force, far down: refused with its row."""
    rows = [*ROWS[:45], row, *ROWS[46:]]
    with pytest.raises(TraceError, match="cut.csv") as error:
        read_trace(written(tmp_path, HEADS["plain"] + "\n".join(rows) + "\n"))
    assert words in str(error.value) and "\n" not in str(error.value)


def test_an_empty_cell_is_left_out_with_a_note(long, tmp_path):
    """A row without a force is no sample, in a long file as in a short one."""
    rows = [*ROWS[:45], "0.45,,45,a", *ROWS[46:]]
    trace = read_trace(written(tmp_path, HEADS["plain"] + "\n".join(rows) + "\n"))
    assert len(trace.time) == N - 1
    assert any("row 47" in note for note in trace.notes)


def test_columns_of_words_are_refused(long, tmp_path):
    """A file without numbers has no columns of numbers."""
    with pytest.raises(TraceError, match="no column of numbers alone"):
        read_table(written(tmp_path, "time_s,force_N\n" + "a,b\n" * 200))


def test_the_names_of_all_rows_take_no_memory(long, tmp_path):
    """A record of which every row is kept has them as a range, and not as a list of as many numbers."""
    trace = read_trace(written(tmp_path, HEADS["plain"] + "\n".join(ROWS) + "\n"))
    assert isinstance(trace.rows, range) and len(trace.rows) == N
