"""A bit of a stored file flips, as disks and transfers do: no number of a run ever comes back changed."""

from __future__ import annotations

import numpy as np
import pytest

from calib.errors import OutputError
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.record_file import read_record, record_errands
from tests.calib.cheap import cut
from tests.calib.simulation.test_evaluation_store import assert_same

HEADER = Header(trace_sha256="ab" * 32, scene_key="banana-2mm")
RUNS = 12


def runs() -> dict[str, Evaluation]:
    """Some runs by key, of which one broke down."""
    random = np.random.default_rng(3)
    made = {}
    for k in range(RUNS):
        curve = random.normal(size=300)
        status, reason = ("failed", "inverted") if k == 4 else ("ok", "")
        values = {"E": 1e5 + k, "R": random.uniform()}
        made[f"{k:064x}"] = Evaluation(k, values, status, reason, 1.0, curve, -curve, {"peak_N": curve[0]}, 0.5)
    return made


def flipped(content: bytes, bit: int) -> bytes:
    """The content with one bit turned over."""
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def whole_store(path):
    """A closed store of all runs; its bytes."""
    with EvaluationStore(path, HEADER) as store:
        for key, run in runs().items():
            store.append(key, run, "fine")
    return path.read_bytes()


def looked_at(path, content, bits):
    """What becomes of each flip: the number of runs that are whole, -1 where the file is refused in one line.

    Raises an error where a run came back changed, and whatever is no refusal.
    """
    wanted, found = runs(), []
    aside = path.with_name(f"{path.name}.damaged")
    for bit in bits:
        path.write_bytes(flipped(content, int(bit)))
        said = []
        try:
            with EvaluationStore(path, HEADER, resume=True, say=said.append) as store:
                for entry in store:
                    assert_same(entry.evaluation, wanted[entry.key])
                    assert store.get(entry.key) is not None
                lost = RUNS - len(store)
                assert lost == store.damaged and bool(said) == bool(lost) == aside.exists()
                found.append(len(store))
        except OutputError as error:
            assert "\n" not in str(error)
            assert path.read_bytes() == flipped(content, int(bit)), "what cannot be read is left as it is"
            found.append(-1)
        aside.unlink(missing_ok=True)
    return np.array(found)


def test_no_flip_changes_a_run(tmp_path):
    """Bits all over the file: each run comes back as it was or is missed, said, and the damaged file kept."""
    path = tmp_path / "evaluations.h5"
    content = whole_store(path)
    found = looked_at(path, content, np.random.default_rng(1).integers(0, 8 * len(content), 30))
    assert (found >= 0).any()


def test_a_flip_in_a_curve_costs_that_run(tmp_path):
    """A bit of a stored force: eleven of twelve runs are there, and the store is whole again afterwards."""
    path = tmp_path / "evaluations.h5"
    content = whole_store(path)
    place = content.index(runs()[f"{3:064x}"].force[7].tobytes())
    assert looked_at(path, content, [8 * place + 13]).tolist() == [RUNS - 1]
    with EvaluationStore(path, HEADER, resume=True) as again:
        assert len(again) == RUNS - 1 and again.damaged == 0
        again.append(f"{3:064x}", runs()[f"{3:064x}"], "fine")
        assert sorted(entry.evaluation.index for entry in again) == list(range(RUNS))


def test_a_flip_in_the_header_costs_nothing(tmp_path):
    """Runs say themselves whose they are: a header with a flipped bit is mended."""
    path = tmp_path / "evaluations.h5"
    content = whole_store(path)
    place = content.index(HEADER.scene_key.encode())
    assert looked_at(path, content, [8 * place]).tolist() == [RUNS]


def test_a_damaged_file_does_not_cost_the_journal(tmp_path):
    """Runs that are in the journal alone are kept where the file beside it is damaged."""
    path = tmp_path / "evaluations.h5"
    content = whole_store(path)
    store = EvaluationStore(path, HEADER, resume=True)
    store.append("later", runs()[f"{0:064x}"], "fine")
    place = content.index(runs()[f"{3:064x}"].force[7].tobytes())
    path.write_bytes(flipped(content, 8 * place))
    with EvaluationStore(path, HEADER, resume=True) as again:
        assert len(again) == RUNS and again.get("later") is not None


@pytest.mark.slow
def test_four_hundred_flips(tmp_path):
    """400 random bits of the file and 400 of the journal: nothing changed, nothing but one line; most runs are kept."""
    path = tmp_path / "evaluations.h5"
    content = whole_store(path)
    found = looked_at(path, content, np.random.default_rng(7).integers(0, 8 * len(content), 400))
    kept = found[found >= 0].sum() / (RUNS * 400)
    assert kept > 0.8, f"{(found < 0).sum()} files refused, {kept:.1%} of all runs kept"
    journal = path.with_name(f"{path.name}.journal")
    path.unlink()
    store = EvaluationStore(path, HEADER)
    for key, run in runs().items():
        store.append(key, run, "fine")
    whole = journal.read_bytes()
    for bit in np.random.default_rng(8).integers(0, 8 * len(whole), 400):
        path.unlink(missing_ok=True)
        journal.write_bytes(flipped(whole, int(bit)))
        again = EvaluationStore(path, HEADER, resume=True)
        assert len(again) >= RUNS - 2
        for entry in again:
            assert_same(entry.evaluation, runs()[entry.key])


def test_no_flip_changes_a_record(tmp_path):
    """A whole record in which a bit flips is the same, or none, so that it is simulated again."""
    food = load_food("banana")
    scene = cut_scene(food, specimen(food, None, Sizing())[0], load_knife("kitchen"))
    path, wanted = tmp_path / "record.h5", cut(scene)
    (errand,) = record_errands(scene, path)
    errand.keep(wanted)
    content = path.read_bytes()
    lost = 0
    for bit in np.random.default_rng(2).integers(0, 8 * len(content), 40):
        path.write_bytes(flipped(content, int(bit)))
        if record_errands(scene, path):
            lost += 1
        else:
            found = read_record(scene, path)
            assert all(
                np.array_equal(getattr(found, n), v, equal_nan=n == "resistance") for n, v in vars(wanted).items()
            )
    assert 0 < lost < 40
