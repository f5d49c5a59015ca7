"""Names, values and lists as errors show them: on one line, not too long, whatever they are."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence

import numpy as np

LETTERS, NAMES = 40, 8
"""Letters of a name or value, and names of a list, that an error shows."""
LONG, WHOLE_LIST = 120, 240
"""Letters of a name that is to be typed again, such as that of a topic, and of a list of such names."""


def brief(value: object, letters: int = LETTERS) -> str:
    """A name or value on one line, with nothing in it that cannot be printed.

    Args:
        value: Text, or anything else; lists that hold themselves and those that are longer than all paper too.
        letters: Most letters.
    """
    plain = value.item() if isinstance(value, np.generic) else value
    text = plain if isinstance(plain, str) else reprlib.repr(plain)
    text = text if text.isprintable() else ascii(text)[1:-1]
    return text if len(text) <= letters else text[: letters - 3] + "..."


def quoted(value: object) -> str:
    """A value as it would be written in Python, text in quotes."""
    if not isinstance(value, str):
        return brief(value)
    return repr(brief(value)) if value.isprintable() else f"'{brief(value)}'"


def listed(names: Sequence[object], letters: int = LETTERS) -> str:
    """The first names of a list, and how many more there are.

    Args:
        names: The names.
        letters: Most letters of each; where names are long, fewer of them are shown.
    """
    shown = [brief(name, letters) for name in names[:NAMES]]
    while len(shown) > 1 and letters > LETTERS and sum(map(len, shown)) > WHOLE_LIST:
        shown.pop()
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")
