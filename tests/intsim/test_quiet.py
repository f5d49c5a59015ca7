"""What the robot simulator warns of on every machine without Vulkan is not repeated by each worker."""

from __future__ import annotations

import subprocess
import sys

from tests.data_dir import ROOT

CODE = "import warnings, intsim; warnings.warn('{}')"


def test_a_library_of_its_own_is_no_warning() -> None:
    """That of SAPIEN is left out; any other one is shown."""
    for words, shown in (("Failed to find system libvulkan. Fallback to SAPIEN", False), ("Something else", True)):
        done = subprocess.run(
            [sys.executable, "-c", CODE.format(words)], cwd=ROOT, capture_output=True, text=True, check=True
        )
        assert (words in done.stderr) is shown
