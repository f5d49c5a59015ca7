"""What a run says of a food: what its user must know now, and where the rest is."""

from __future__ import annotations

from calib.material.food import FoodSpec
from calib.material.own_food import FLAG

_DEFAULT = FLAG.partition("{")[0]
"""How the flag of a value begins that a food's own file leaves out."""


def notes(food: FoodSpec) -> list[str]:
    """Sentences that a run prints: as :meth:`FoodSpec.warnings`, but remarks on published values are only counted.

    Such remarks are the same in every run of a food. They are in the summary and the report, and ``cutcal foods`` shows
    them.

    Args:
        food: The food.

    Returns:
        The sentences.
    """
    both = {"shape": food.sizes, "properties": food.properties}
    remarks = [
        f"{food.name}.{group}.{name}: {text}"
        for group, items in both.items()
        for name, item in items.items()
        for text in item.warnings()
        if text == item.flag or text == item.disagreement
        if not text.startswith(_DEFAULT)
    ]
    said = [text for text in food.warnings() if text not in remarks]
    if remarks:
        many = "a remark" if len(remarks) == 1 else f"{len(remarks)} remarks"
        said.append(f"{food.name}: {many} on published values, which cutcal foods {food.name} and the report have")
    return said
