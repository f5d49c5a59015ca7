"""Draw the foods' prior predictives as they are recorded: python docs/foods.py docs/foods.png"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from calib.io.yaml_checks import data_path
from reports.base.figures import MM, STYLE, WIDTH
from reports.calibration.prior import draw, foods, height


def main(picture: Path) -> None:
    """One panel for each food of force_data/prior_predictive."""
    folder = data_path("force_data") / "prior_predictive"
    names = foods(folder)
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(WIDTH * MM, height(names) * MM), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure, folder, names)
        figure.savefig(picture, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
