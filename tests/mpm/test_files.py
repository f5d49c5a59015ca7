import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mpm.files import replacing, write_atomic
from tests.data_dir import ROOT


def test_text_and_bytes_replace_the_old_file(tmp_path: Path) -> None:
    """Text comes back as UTF-8 and bytes as they are, a file that was there is gone, and no draft is left."""
    path = tmp_path / "a.txt"
    write_atomic(path, "é\n")
    assert path.read_text(encoding="utf-8") == "é\n"
    write_atomic(path, b"\xff\x00", sync=True)
    assert path.read_bytes() == b"\xff\x00"
    assert list(tmp_path.iterdir()) == [path]


def test_the_old_file_is_there_until_the_block_has_ended(tmp_path: Path) -> None:
    """While the draft is written, the file holds what it held."""
    path = tmp_path / "a.h5"
    write_atomic(path, "old")
    with replacing(path) as draft:
        assert draft.name == "a.h5.draft"
        draft.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"


def test_a_block_that_raises_leaves_the_old_file(tmp_path: Path) -> None:
    """Whatever is raised, the old file stays as it was and the draft is removed."""
    path, own = tmp_path / "a.mp4", tmp_path / "draft-a.mp4"
    write_atomic(path, "old")
    for kind in (OSError, ValueError, KeyboardInterrupt):
        with pytest.raises(kind), replacing(path, draft=own):
            own.write_text("half")
            raise kind
        assert path.read_text() == "old" and not own.exists()


def test_a_file_that_cannot_be_put_in_place(tmp_path: Path) -> None:
    """A folder of that name, or a folder that is not there, is an OSError of its own words, and no draft is left."""
    (tmp_path / "a").mkdir()
    with pytest.raises(IsADirectoryError):
        write_atomic(tmp_path / "a", "text")
    with pytest.raises(FileNotFoundError):
        write_atomic(tmp_path / "none" / "a", "text")
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_a_kill_leaves_the_old_file(tmp_path: Path) -> None:
    """A process that is killed while it writes leaves the old file, and the next one writes over its draft."""
    path = tmp_path / "a"
    write_atomic(path, "old")
    code = (
        "import os, signal, sys; from pathlib import Path; from mpm.files import replacing\n"
        "with replacing(Path(sys.argv[1])) as draft:\n"
        "    draft.write_text('half'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    assert done.returncode == -signal.SIGKILL
    assert path.read_text() == "old" and (tmp_path / "a.draft").read_text() == "half"
    write_atomic(path, "new")
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_files_are_put_in_place_here_alone() -> None:
    """No other module renames a draft by hand, but for the recorded curves: there two files change together."""
    packages = ("mpm", "fem_reference", "calib", "studies", "intsim", "cutcal", "reports")
    files = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    renaming = {p.relative_to(ROOT).as_posix() for p in files if "os.replace(" in p.read_text(encoding="utf-8")}
    assert renaming == {"mpm/files.py", "studies/regression/reference_curves.py"}
