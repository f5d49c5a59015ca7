"""What the paper prints of each figure: numbers that stand in its text and tables, and no other.

The paper is *CulinaryCut: A Physics-Grounded Cutting Benchmark for Vision-Language-Action Models*. Bars and radar
charts without a number beside them are not read off: their rows have none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

ONE_FOOD, SEVERAL_FOODS = "one food on the table", "one to three other foods beside it"
SEEN_FOOD, UNSEEN_FOOD = "foods of the training, words of the training", "food left out, words not seen"
ALL_FOODS = "all foods"
GEOMETRY, WITH_FOOD, REAL_ROBOT = "geometry", "with the food", "real robot"
TRIALS = "The paper has 20 trials of each food and task (Sec. 4.1); ours are counted in the cells."
REGION = 'Ours reads "the blade intersects the region" as the edge being inside the food; the paper does not say how.'
Printed = Mapping[str, float]
"""Rates of success by model [-]."""
SINGLE_OBJECT: Printed = {"RDT": 0.69, "Octo": 0.42, "OpenVLA": 0.51}


@dataclass(frozen=True)
class PublishedFigure:
    """What the paper prints of a figure.

    Attributes:
        title: What it shows.
        source: Where the numbers stand in the paper.
        differs: What differs between the paper's experiment and ours, whoever moves the knife.
        rates: Rates of success by row and model [-]; a row that is not here has no number in the paper.
        words: What the paper says in words where it prints no number; empty where all are printed.
        models: Names of the models that it is about.
    """

    title: str
    source: str
    differs: tuple[str, ...]
    rates: Mapping[str, Printed] = field(default_factory=dict)
    words: str = ""
    models: tuple[str, ...] = ("RDT", "Octo", "OpenVLA")


def split_row(food: str, pieces: int, cut: int) -> str:
    """Name of a row of Table 3.

    Args:
        food: Name of the food.
        pieces: Equal pieces that are asked for.
        cut: Number of the cut, from 1.

    Returns:
        The name.
    """
    return f"{food} in {pieces}, cut {cut}"


def transfer_row(trained: str, tested: str) -> str:
    """Name of a row of Fig. 8."""
    return f"trained on {trained}, tested on {tested}"


def training_row(demos: str, judged: str) -> str:
    """Name of a rate of Table 4: RDT trained in ``ManiSkill`` or ``IntSim``, and how it was judged."""
    return f"{demos}, {judged}"


_TABLE_3 = {
    ("banana", 3): (0.20, 0.0),
    ("banana", 4): (0.10, 0.05, 0.0),
    ("banana", 5): (0.05, 0.0, 0.0, 0.0),
    ("cucumber", 3): (0.30, 0.0),
    ("cucumber", 4): (0.10, 0.0, 0.0),
    ("cucumber", 5): (0.0, 0.0, 0.0, 0.0),
}
_TABLE_4 = {"ManiSkill": (0.62, 0.23, 0.1), "IntSim": (0.68, 0.59, 0.3)}
_FIG_8 = {
    ("0.25 from the right", "0.25 from the left"): (0.55, 0.20),
    ("0.75 from the right", "0.25 from the right"): (0.35, 0.0),
    ("0.5 in the middle", "0.25 from the right"): (0.60, 0.25),
}

PUBLISHED: Mapping[str, PublishedFigure] = {
    "fig4": PublishedFigure(
        "success by food, alone on the table",
        "Fig. 4, a bar chart without numbers; the means over all foods are in Sec. 4.3 (II)",
        (REGION, TRIALS, "The paper does not say how far its foods are moved, turned and scaled."),
        {ALL_FOODS: SINGLE_OBJECT},
        "reasonable success on large and distinct foods, larger errors of the place on small ones",
    ),
    "fig5": PublishedFigure(
        "one food on the table against several",
        "Fig. 5 and Sec. 4.3 (II)",
        (REGION, TRIALS, "The paper does not say how many other foods lie beside; ours are one to three."),
        {ONE_FOOD: SINGLE_OBJECT, SEVERAL_FOODS: {"RDT": 0.31, "Octo": 0.17, "OpenVLA": 0.28}},
    ),
    "fig6": PublishedFigure(
        "a food that training left out, in words that it has not seen",
        "Fig. 6 and Sec. 4.3 (III)",
        (
            REGION,
            TRIALS,
            "The paper leaves one food out at a time and trains again for each; several folders in --from do the same.",
        ),
        {SEEN_FOOD: SINGLE_OBJECT, UNSEEN_FOOD: {"RDT": 0.43, "Octo": 0.34, "OpenVLA": 0.26}},
    ),
    "fig7": PublishedFigure(
        "any part from 0.1 to 0.9, in numbers",
        "Fig. 7, radar charts without numbers; Sec. 4.3 (IV)",
        (REGION, TRIALS, "Ours draws left or right for each episode; the paper names the right in an example."),
        words="all three unstable between ratios that are close; Octo and OpenVLA often fail at those in the middle",
    ),
    "table3": PublishedFigure(
        "equal pieces, cut by cut",
        "Table 3 (RDT)",
        (
            "Ours measures each cut against the largest piece that is left, to a tenth of its length; the paper does "
            "not say of what its tenth is.",
            "A cut that was not made counts as missed.",
            TRIALS,
        ),
        {
            split_row(food, pieces, k): {"RDT": rate}
            for (food, pieces), rates in _TABLE_3.items()
            for k, rate in enumerate(rates, 1)
        },
        models=("RDT",),
    ),
    "table4": PublishedFigure(
        "motions that geometry plans against motions that part the food (orange)",
        "Table 4 (RDT)",
        (
            REGION,
            "The paper does not say when a food counts as severed; ours counts pieces in the solver that no bond holds "
            "together.",
            "The paper does not say how many trials it has; 62 % is no share of 20.",
        ),
        {
            training_row(demos, judged): {"RDT": rate}
            for demos, rates in _TABLE_4.items()
            for judged, rate in zip((GEOMETRY, WITH_FOOD, REAL_ROBOT), rates, strict=True)
        },
        models=("RDT",),
    ),
    "fig8": PublishedFigure(
        "trained on one cut, tested on its counterpart",
        "Fig. 8 and Sec. 4.4 (RDT)",
        (
            REGION,
            "The paper names a banana as an example and no food for the numbers, nor the sides of its cuts at 0.75 and "
            "0.5; ours measures 0.75 from the right and makes the half in the middle.",
            TRIALS,
        ),
        {
            transfer_row(trained, task): {"RDT": rate}
            for (trained, other), rates in _FIG_8.items()
            for task, rate in zip((trained, other), rates, strict=True)
        },
        models=("RDT",),
    ),
}
"""By the name of the figure."""
