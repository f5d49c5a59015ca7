"""The twenty wrong pairs and the twenty right ones, chosen before any of them was judged."""

from __future__ import annotations

from studies.discrimination.pair import RIGHT, Cut, Pair, backwards, negative

PIECE = 0.024
"""Height of the pieces of large foods [m]: a cut of one takes a second on a core, of the whole food up to ten."""
WIDER = 1.3
"""A width that is wrong by 30 %."""
FOOD, TRACE, KNIFE, WIDTH, HEIGHT = "wrong food", "another food's trace", "wrong knife", "wrong width", "wrong height"
REVERSED, SIGN = "reversed trace", "wrong sign"


def _piece(food: str, knife: str = "kitchen") -> Cut:
    return Cut(food, knife, PIECE)


WRONG: tuple[Pair, ...] = (
    Pair("melon-of-apple", FOOD, _piece("apple", "edc"), Cut("melon"), told=False),
    Pair("strawberry-of-cucumber", FOOD, _piece("cucumber"), Cut("strawberry")),
    Pair("apple-of-strawberry", FOOD, Cut("strawberry"), _piece("apple")),
    Pair("strawberry-of-apple", FOOD, _piece("apple"), Cut("strawberry")),
    Pair("potato-of-kiwi", FOOD, _piece("kiwi"), _piece("potato")),
    Pair("grape-of-potato", FOOD, _piece("potato"), Cut("grape")),
    Pair("trace-strawberry-as-banana", TRACE, Cut("strawberry"), Cut("banana"), own=True),
    Pair("trace-cherry-as-grape", TRACE, Cut("cherry"), Cut("grape"), own=True),
    Pair("trace-banana-as-apple", TRACE, Cut("banana"), _piece("apple"), own=True),
    Pair("trace-grape-as-strawberry", TRACE, Cut("grape"), Cut("strawberry"), own=True),
    Pair("knife-apple", KNIFE, _piece("apple", "edc"), _piece("apple", "slicing")),
    Pair("knife-potato", KNIFE, _piece("potato", "edc"), _piece("potato")),
    Pair("knife-grape", KNIFE, Cut("grape", "edc"), Cut("grape")),
    Pair("width-cherry", WIDTH, Cut("cherry"), Cut("cherry"), sizes={"width": WIDER}),
    Pair("width-strawberry", WIDTH, Cut("strawberry"), Cut("strawberry"), sizes={"width": 1 / WIDER}),
    Pair("width-apple", WIDTH, _piece("apple"), _piece("apple"), sizes={"width": 1 / WIDER}),
    Pair("reversed-strawberry", REVERSED, Cut("strawberry"), Cut("strawberry"), backwards),
    Pair("reversed-grape", REVERSED, Cut("grape"), Cut("grape"), backwards),
    Pair("height-strawberry", HEIGHT, Cut("strawberry"), Cut("strawberry"), sizes={"height": WIDER}),
    Pair("sign-strawberry", SIGN, Cut("strawberry"), Cut("strawberry"), negative, sign="+"),
)


def _right(food: str, count: int, knife: str = "kitchen", first: int = 1) -> list[Pair]:
    cut = _piece(food, knife) if food in ("apple", "potato") else Cut(food, knife)
    return [Pair(f"right-{food}-{k}", RIGHT, cut, cut) for k in range(first, first + count)]


CORRECT: tuple[Pair, ...] = (
    *_right("banana", 1),
    *_right("banana", 1, "edc", 2),
    *_right("strawberry", 3),
    *_right("strawberry", 1, "slicing", 4),
    *_right("strawberry", 1, "edc", 5),
    *_right("grape", 4),
    *_right("grape", 1, "edc", 5),
    *_right("cherry", 3),
    *_right("cherry", 1, "edc", 4),
    *_right("apple", 1),
    *_right("apple", 1, "edc", 2),
    *_right("potato", 1),
    *_right("potato", 1, "edc", 2),
)
PAIRS: tuple[Pair, ...] = (*WRONG, *CORRECT)
