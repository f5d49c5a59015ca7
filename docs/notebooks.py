"""Runs the notebooks of this folder and keeps what they show: ``python docs/notebooks.py`` after a change."""

from __future__ import annotations

import base64
import io
import os
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

FOLDER = Path(__file__).parent / "notebooks"
COLOURS = 32
"""Colours of a picture: it is a third as large as with all."""
TIMEOUT_S = 600
"""Time of a cell after which it is given up [s]."""


def executed(path: Path, folder: Path) -> nbformat.NotebookNode:
    """A notebook run from its first cell to its last, in a new kernel.

    Args:
        path: The notebook.
        folder: Current folder of the kernel.

    Returns:
        The notebook with its outputs.

    Raises:
        nbclient.exceptions.CellExecutionError: A cell ends with an error.
    """
    notebook = nbformat.read(path, as_version=4)
    where = {"metadata": {"path": str(folder)}}
    NotebookClient(notebook, timeout=TIMEOUT_S, kernel_name="python3", resources=where).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # times
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = _smaller(output.data["image/png"])
    notebook.metadata["language_info"] = {"name": "python"}
    return notebook


def _smaller(picture: str) -> str:
    """A PNG with few colours, in base 64 as it came."""
    out = io.BytesIO()
    image = Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB")
    image.quantize(COLOURS).save(out, "PNG", optimize=True)
    return base64.b64encode(out.getvalue()).decode()


def main() -> None:
    """Run all, in a folder that is gone afterwards."""
    os.environ["PYTHONPATH"] = str(FOLDER.parents[1])
    with tempfile.TemporaryDirectory() as folder:
        for path in sorted(FOLDER.glob("*.ipynb")):
            nbformat.write(executed(path, Path(folder)), path)


if __name__ == "__main__":
    main()
