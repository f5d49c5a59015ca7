"""What a finished run has in its folder, be it of one cut or of several."""

from __future__ import annotations

from pathlib import Path

from calib.material.food import FoodSpec, load_material_file


class RunFolder:
    """A finished run whose files lie in a folder.

    Attributes:
        folder: The output folder.
    """

    folder: Path

    @property
    def material(self) -> FoodSpec:
        """The calibrated food.

        Raises:
            MaterialError: material.yaml is missing or damaged.
        """
        return load_material_file(self.folder / "material.yaml")

    @property
    def report(self) -> Path:
        """Path of the report."""
        return self.folder / "report.pdf"
