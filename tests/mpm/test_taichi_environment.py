"""A home that is missing or cannot be written ends no process."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from mpm import taichi_environment
from mpm.taichi_environment import CACHE, prepare_taichi
from tests.data_dir import ROOT

pytestmark = pytest.mark.skipif(os.name != "posix", reason="only elsewhere Taichi looks for a home")


@pytest.mark.parametrize("home", [None, "/proc/1", "/dev/null"])
def test_a_home_that_cannot_be_used(home, tmp_path, monkeypatch):
    """Kernels are kept among the temporary files, in a folder of the user that the next process finds again."""
    monkeypatch.setattr(taichi_environment.tempfile, "gettempdir", lambda: str(tmp_path))
    found = []
    for _ in range(2):
        monkeypatch.delenv(CACHE, raising=False)
        monkeypatch.delenv("HOME", raising=False)
        if home is not None:
            monkeypatch.setenv("HOME", home)
        prepare_taichi()
        found.append(os.environ[CACHE])
    (folder,) = tmp_path.iterdir()
    assert found == [str(folder)] * 2 and folder.stat().st_mode & 0o077 == 0
    monkeypatch.setattr(taichi_environment.tempfile, "tempdir", str(tmp_path))
    folder.chmod(0o777)  # of anybody
    monkeypatch.delenv(CACHE)
    prepare_taichi()
    assert os.environ[CACHE] != str(folder)


def test_a_home_that_can_be_used_is(tmp_path, monkeypatch):
    """What the user has set stays."""
    monkeypatch.delenv(CACHE, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    prepare_taichi()
    assert CACHE not in os.environ
    monkeypatch.setenv(CACHE, str(tmp_path / "own"))
    prepare_taichi()
    assert os.environ[CACHE] == str(tmp_path / "own")


def test_a_stream_of_a_notebook_is_not_spoken_of():
    """Where standard output is not Python's own, as in a notebook, importing Taichi says nothing."""
    code = (
        "import io, contextlib\n"
        "with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:\n"
        "    import mpm.solver\n"
        "print(repr(out.getvalue() + err.getvalue()))"
    )
    variables = {name: value for name, value in os.environ.items() if not name.startswith("TI_")}
    environment = variables | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == ("''", "")
