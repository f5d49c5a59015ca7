"""The RLDS export: records whose checksums hold, read back by a reader that knows nothing of the writer."""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import pytest

from calib.errors import OutputError
from intsim.data import generate as g
from intsim.data.dataset_document import DatasetSpec
from intsim.data.lerobot import episode_columns
from intsim.data.manifest import Manifest
from intsim.data.rlds import VALIDATION_STRIDE, _varint, export_rlds
from intsim.data.shards import trajectories
from tests.intsim.data.test_generate import Inline
from tests.intsim.painter import PIXELS, Here, Painter, paint_with

crc = pytest.importorskip("google_crc32c", reason="the extra [data] is not installed")
Image = pytest.importorskip("PIL.Image", reason="the extra [data] is not installed")


def records(path) -> list[bytes]:
    """Content of each record; length and content are checked."""
    data, out, at = path.read_bytes(), [], 0
    while at < len(data):
        (length,) = struct.unpack_from("<Q", data, at)
        for begin, size in ((at, 8), (at + 12, length)):
            (masked,) = struct.unpack_from("<I", data, begin + size)
            turned = (masked - 0xA282EAD8) & 0xFFFFFFFF
            assert (turned >> 17 | turned << 15) & 0xFFFFFFFF == crc.value(data[begin : begin + size])
        out.append(data[at + 12 : at + 12 + length])
        at += 16 + length
    return out


def fields(message: bytes) -> list[tuple[int, bytes]]:
    """Numbers and contents of the fields of a message, all of which have a length."""
    out, at = [], 0

    def varint() -> int:
        nonlocal at
        value, shift = 0, 0
        while True:
            byte = message[at]
            at, value, shift = at + 1, value | (byte & 0x7F) << shift, shift + 7
            if byte < 0x80:
                return value

    while at < len(message):
        key = varint()
        assert key & 7 == 2
        size = varint()
        out.append((key >> 3, message[at : at + size]))
        at += size
    return out


def read(record: bytes) -> dict:
    """Lists by name."""
    out = {}
    ((_, whole),) = fields(record)
    for _, entry in fields(whole):
        (_, name), (_, feature) = fields(entry)
        ((kind, values),) = fields(feature)
        parts = [content for _, content in fields(values)]
        if kind == 2:
            parts = np.frombuffer(parts[0], "<f4")
        elif kind == 3:
            parts = np.frombuffer(parts[0], np.uint8)  # flags are a byte each
        out[name.decode()] = parts
    return out


@pytest.fixture
def exported(tmp_path, monkeypatch):
    """Twenty-one made-up trajectories before two backgrounds."""
    monkeypatch.setattr(g, "require_simulator", lambda: None)
    g.generate(DatasetSpec(Manifest(trajectories=VALIDATION_STRIDE + 1), shard=30), tmp_path / "set", Inline())
    paint_with(Painter, monkeypatch)
    export_rlds(tmp_path / "set", tmp_path / "rlds", backgrounds=[0, 2], pixels=PIXELS, pool=Here())
    return tmp_path / "set", tmp_path / "rlds" / "cutcal" / "1.0.0"


def test_records_hold_what_was_stored(exported):
    """Every episode of both splits: state, action, flags, sentence and pictures; no force anywhere."""
    stored, home = exported
    train = records(home / "cutcal-train.tfrecord-00000-of-00001")
    wanted = [episode_columns(one) for one in trajectories(stored)]
    assert len(train) == 2 * VALIDATION_STRIDE
    for k, content in enumerate(train):
        found = read(content)
        index = k % VALIDATION_STRIDE if k % VALIDATION_STRIDE < VALIDATION_STRIDE - 1 else VALIDATION_STRIDE
        want = wanted[index]
        n = len(want["timestamp"])
        assert np.array_equal(found["steps/action"].reshape(n, 7), want["action"])
        assert np.array_equal(found["steps/observation/state"].reshape(n, 8), want["observation.state"])
        assert found["steps/is_first"].tolist() == [1] + [0] * (n - 1)
        assert found["steps/is_last"].tolist() == found["steps/is_terminal"].tolist() == [0] * (n - 1) + [1]
        assert found["steps/reward"].sum() == 1 and len(set(found["steps/language_instruction"])) == 1
        told = {found[name][0] for name in found if name.startswith("steps/language_instruction")}
        assert len(told) == 5 and found["steps/language_instruction"][0] in told
        assert len(found["steps/observation/wrist_image"]) == n
        picture = np.array(Image.open(io.BytesIO(found["steps/observation/image"][3])))
        assert picture.shape == (PIXELS, PIXELS, 3)
        assert picture.mean() == pytest.approx(30 + (0 if k < VALIDATION_STRIDE else 80), abs=2)
        assert not [name for name in found if "force" in name or "contact" in name]


def test_validation_is_whole_trajectories_before_every_background(exported):
    """One of twenty, in no training record; the counts of dataset_info.json are those of the files."""
    _, home = exported
    splits = {s["name"]: s for s in json.loads((home / "dataset_info.json").read_text())["splits"]}
    for name, split in splits.items():
        found = records(home / f"cutcal-{name}.tfrecord-00000-of-00001")
        assert split["shardLengths"] == [str(len(found))] and split["numBytes"] == str(sum(map(len, found)))
        paths = [read(r)["episode_metadata/file_path"][0].decode() for r in found]
        assert len(set(paths)) == len(paths)
        assert all(("trajectory 19," in path) == (name == "val") for path in paths)
    assert splits["val"]["shardLengths"] == ["2"]


def test_every_feature_is_described(exported):
    """features.json names what the records have, and nothing else."""
    _, home = exported

    def names(part: dict, before: str = "") -> set[str]:
        if "sequence" in part:
            return names(part["sequence"]["feature"], before)
        if "featuresDict" not in part:
            return {before}
        inner = part["featuresDict"]["features"]
        return set().union(*(names(one, f"{before}/{name}" if before else name) for name, one in inner.items()))

    record = read(records(home / "cutcal-val.tfrecord-00000-of-00001")[0])
    assert names(json.loads((home / "features.json").read_text())) == set(record)


def test_numbers_of_any_size_are_written_as_protocol_buffers_have_them():
    """Seven bits a byte, the lowest first (the example of the format's own documentation: 150 is 96 01)."""
    assert _varint(0) == b"\x00" and _varint(127) == b"\x7f" and _varint(150) == b"\x96\x01"


def test_without_a_background_it_says_so(tmp_path):
    """Such a policy looks at pictures."""
    with pytest.raises(OutputError, match="--scenes"):
        export_rlds(tmp_path, tmp_path / "x", backgrounds=[])
