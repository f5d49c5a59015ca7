"""Runs the scripts of the gallery and keeps their pictures: ``python docs/gallery.py`` after a change of one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

FOLDER = Path(__file__).parent / "gallery"
COLOURS = 256
"""Colours of a picture: it is a third as large as with all."""


def main() -> None:
    """Run all in one folder, which is gone afterwards: a calibration that several of them show is made once."""
    environment = os.environ | {"PYTHONPATH": str(FOLDER.parents[1])}
    with tempfile.TemporaryDirectory() as folder:
        for script in sorted(FOLDER.glob("*.py")):
            subprocess.run([sys.executable, str(script)], cwd=folder, env=environment, check=True)
        for path in sorted(Path(folder).glob("*.png")):
            image = Image.open(path).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
            image.save(FOLDER / path.name, optimize=True)


if __name__ == "__main__":
    main()
