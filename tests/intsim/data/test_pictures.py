"""Pictures of a dataset: each made once and kept, whatever stops it, and only where there is something to render
with."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from calib.errors import OutputError
from calib.io.typed_document import to_document
from cutcal.main import main
from intsim.data import generate as g
from intsim.data.dataset_document import DATASET_FILE, DatasetDocument, DatasetSpec
from intsim.data.export_episodes import export_episodes
from intsim.data.lerobot import export_lerobot
from intsim.data.manifest import Manifest
from intsim.data.pictures import load_pictures, png_bytes, render_dataset, require_renderer
from intsim.data.rdt import export_rdt
from intsim.data.rlds import export_rlds
from intsim.data.shards import trajectories
from intsim.render.view import PICTURE_CAMERAS
from mpm.scene.errors import CutcalError
from tests.calib.documents import valid
from tests.calib.io.test_meaning import assert_told, sets
from tests.intsim.data.test_generate import Inline
from tests.intsim.painter import PIXELS, Here, Painter, paint_with

pytest.importorskip("PIL.Image", reason="the extra [data] is not installed")
COUNT, SHARD = 5, 2


@pytest.fixture
def made(tmp_path, monkeypatch) -> Path:
    """Five made-up trajectories in shards of two, and a painter."""
    monkeypatch.setattr(g, "require_simulator", lambda: None)
    paint_with(Painter, monkeypatch)
    g.generate(DatasetSpec(Manifest(trajectories=COUNT), shard=SHARD), tmp_path / "set", Inline())
    return tmp_path / "set"


def files(folder: Path) -> list[str]:
    """Names of what holds pictures."""
    return sorted(p.name for p in folder.iterdir() if p.name.startswith("picture"))


def test_what_was_rendered_comes_back_pixel_by_pixel(made):
    """Of every trajectory before every background, from files beside their shard; dataset.json says what it took."""
    found = render_dataset(made, [0, 2], PIXELS, Here())
    assert files(made) == [f"pictures-32-{scene:02d}-{n:04d}.h5" for scene in (0, 2) for n in range(3)]
    assert_told(sets(made / files(made)[0]))
    document = valid(json.loads((made / DATASET_FILE).read_text()))
    steps = document["steps"]
    assert document["pictures"] == to_document(found)
    assert found.scenes == (0, 2) and found.number == 2 * len(PICTURE_CAMERAS) * steps
    assert found.core_hours_of_315000 == pytest.approx(21_000 * 15 * found.seconds_per_episode / 3600)
    assert found.bytes > 0 and DatasetDocument.read(made).pictures == found
    for stored in trajectories(made):
        for scene in (0, 2):
            wanted = Painter(PIXELS).pictures(stored, scene)
            seen = load_pictures(made, stored, scene, PIXELS)
            assert set(seen) == set(PICTURE_CAMERAS) and all(
                np.array_equal(seen[view], wanted[view]) for view in PICTURE_CAMERAS
            )


@pytest.mark.parametrize("packer", ["isal", "zlib"])
@pytest.mark.parametrize("shape", [(1, 1), (5, 7), (64, 64)])
def test_a_png_has_every_pixel(packer, shape, monkeypatch):
    """Pillow, which had no part in writing it, reads back what was given, noise and one colour: whichever library packs
    it."""
    from PIL import Image

    if packer == "isal":
        pytest.importorskip("isal", reason="the extra [robot] is not installed")
    else:
        monkeypatch.setitem(sys.modules, "isal", None)
    noise = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    for frame in (noise, np.full_like(noise, 200)):
        with Image.open(io.BytesIO(png_bytes(frame))) as image:
            image.verify()
        with Image.open(io.BytesIO(png_bytes(frame))) as image:
            assert image.mode == "RGB" and np.array_equal(np.asarray(image), frame)


@pytest.mark.parametrize("stop", [1, SHARD, COUNT - 1])
def test_stopped_anywhere_it_goes_on_and_renders_nothing_twice(made, stop):
    """Parts outlive a stop and are gone afterwards; a part that was left beside its complete file as well."""
    with pytest.raises(KeyboardInterrupt):
        render_dataset(made, [0, 2], PIXELS, Here(stop))
    rest = Here(COUNT - stop)
    render_dataset(made, [0, 2], PIXELS, rest)
    assert rest.most == 0 and len(files(made)) == 6
    (made / "picture-32-02-000004.h5").touch()  # killed before it was removed
    render_dataset(made, [0, 2], PIXELS, Here(0))
    assert len(files(made)) == 6 and len(list(export_episodes(made, [0, 2], PIXELS))) == 2 * COUNT


def test_a_further_background_or_size_is_added_and_physics_never_made_again(made):
    """Each is in files of its own; making the dataset again leaves them and what they took."""
    render_dataset(made, [1], PIXELS, Here())
    said: list[str] = []
    one = render_dataset(made, [1, 3], PIXELS, Here(COUNT), said.append)
    assert said[0] == "pictures of 5 of 10 are there already" and len(said) == 1 + COUNT
    render_dataset(made, [1], 16, Here(COUNT))
    again = g.generate(DatasetSpec(Manifest(trajectories=COUNT), shard=SHARD), made, Inline(0), resume=True)
    assert len(files(made)) == 9 and one.scenes == (1, 3)
    assert again.pictures is not None and again.pictures.pixels == 16 and valid(again.as_dict())


def test_pictures_stay_with_their_shard_where_one_before_it_is_still_missing(made):
    """Rendered of a dataset that is not finished, they are those of the same trajectories when it is."""
    late = [made / f"shard-0001{end}" for end in (".h5", ".json")]
    kept = [path.read_bytes() for path in late]
    for path in late:
        path.unlink()
    render_dataset(made, [0], PIXELS, Here())
    for path, content in zip(late, kept, strict=True):
        path.write_bytes(content)
    assert files(made) == ["pictures-32-00-0000.h5", "pictures-32-00-0002.h5"]
    render_dataset(made, [0], PIXELS, Here(SHARD))
    assert [one.shard for one in trajectories(made)] == [0, 0, 1, 1, 2] and len(
        list(export_episodes(made, [0], PIXELS))
    ) == COUNT


def test_one_command_makes_trajectories_and_pictures(tmp_path, monkeypatch, capsys):
    """``generate --scenes``: both, with what each costs; an export then renders nothing."""
    monkeypatch.setattr(g, "require_simulator", lambda: None)
    paint_with(Painter, monkeypatch)

    class Both(Here):
        """Made-up episodes, painted pictures."""

        def each(self, work, jobs):
            yield from Inline().each(work, jobs) if work is g.make_episode else super().each(work, jobs)

    monkeypatch.setattr("cutcal.commands.dataset.dataset.workers_of", lambda args, say: Both())
    out = tmp_path / "set"
    words = ["dataset", "generate", "--episodes", "3", "--scenes", "0,2,0", "--pixels", "32", "--out", str(out)]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "288 pictures before 2 backgrounds" in told and "core hours" in told
    assert "at this pace the 21,000 trajectories of the published data set take" in told
    assert "at this pace those 21,000 before its 15 backgrounds take" in told
    assert main([*words, "--resume", "--json"]) == 0
    assert valid(json.loads(capsys.readouterr().out))["pictures"]["scenes"] == [0, 2]
    monkeypatch.setattr("cutcal.commands.dataset.dataset.workers_of", lambda args, say: Here(0))
    pytest.importorskip("pyarrow", reason="the extra [data] is not installed")
    pytest.importorskip("av", reason="the extra [data] is not installed")
    export = ["dataset", "export", str(out), "--scenes", "0,2", "--pixels", "32", "--out"]
    assert main([*export, str(tmp_path / "lerobot")]) == 0
    told = capsys.readouterr()
    info = json.loads((tmp_path / "lerobot" / "meta" / "info.json").read_text())
    whole = f"{info['total_episodes']} episodes of {info['total_frames']} frames: one for each trajectory, background"
    assert f"{whole} and sentence that asks for it ({info['total_tasks']} sentences in all)" in told.out
    assert "trajectory before a background 6 of 6" in told.err and "episode" not in told.err
    assert main([*export, str(tmp_path / "rlds"), "--format", "rlds"]) == 0


@pytest.mark.parametrize("export", [export_lerobot, export_rlds, export_rdt])
def test_an_export_that_is_stopped_while_it_renders_can_be_asked_for_again(made, tmp_path, export):
    """Its folder is made when the pictures are there, and the second time renders the rest alone."""
    pytest.importorskip("pyarrow", reason="the extra [data] is not installed")
    pytest.importorskip("av", reason="the extra [data] is not installed")
    with pytest.raises(KeyboardInterrupt):
        export(made, tmp_path / "out", backgrounds=[0], pixels=PIXELS, pool=Here(2))
    assert not (tmp_path / "out").exists()
    rest = Here(COUNT - 2)
    export(made, tmp_path / "out", backgrounds=[0], pixels=PIXELS, pool=rest)
    assert rest.most == 0


def test_without_a_renderer_nothing_is_simulated(made, monkeypatch, tmp_path, capsys):
    """What is missing is said before the first trajectory; so is a renderer that ends its process, and a background
    that does not exist."""

    class Blind(Painter):
        """There is nothing to render with."""

        def __init__(self, pixels: int, threads: int = 1) -> None:
            raise CutcalError("dataset: no pictures without a renderer")

    class Killed(Here):
        """Each job takes its process along."""

        def each(self, work, jobs):
            yield from ((k, None) for k, _ in enumerate(jobs))

    paint_with(Blind, monkeypatch)
    monkeypatch.setattr("cutcal.commands.dataset.dataset.workers_of", lambda args, say: Here())
    assert main(["dataset", "generate", "--scenes", "0", "--out", str(tmp_path / "new")]) == 1
    assert "no pictures without a renderer" in capsys.readouterr().err and not (tmp_path / "new").exists()
    with pytest.raises(OutputError, match="cutcal doctor"):
        require_renderer(Killed(), [0], PIXELS)
    with pytest.raises(OutputError, match="killed twice"):
        render_dataset(made, [0], PIXELS, Killed())
    for scenes in ([15], [-1]):
        with pytest.raises(OutputError, match="0 to 14"):
            require_renderer(Here(), scenes, PIXELS)


def test_pictures_that_are_not_there_or_damaged_are_an_error(made):
    """Named, with what to do; of a folder whose document is gone nothing is rendered."""
    with pytest.raises(OutputError, match="pictures-32-00-0000.h5"):
        next(export_episodes(made, [0], PIXELS))
    render_dataset(made, [0], PIXELS, Here())
    (made / "pictures-32-00-0001.h5").write_bytes(b"none")
    with pytest.raises(OutputError, match=r"pictures-32-00-0001.h5.*remove it"):
        list(export_episodes(made, [0], PIXELS))
    for broken in ("{", None):
        (made / DATASET_FILE).unlink() if broken is None else (made / DATASET_FILE).write_text(broken)
        with pytest.raises(OutputError, match=r"dataset.json.*make the dataset again"):
            render_dataset(made, [1], PIXELS, Here(0))
