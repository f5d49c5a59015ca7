"""Names, values and lists as errors show them: on one line, not too long, whatever they are."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from mpm.scene.errors import CutcalError

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


OPTION = re.compile(r"(?<![\w-])--([a-z][a-z-]*[a-z])")
"""An option of the command line in a sentence."""
COMMAND = re.compile(r"\b(?:cutcal [a-z]+|calibrate)(?: [A-Z]+)?(?: --[a-z-]+(?: [\w.]+)?)* $")
"""What stands before an option that is part of a command to be typed, such as ``cutcal foods --template``."""
ARGUMENTS = {
    "material": "food",
    "run": "start",
    "config": "Study.read",
    "all": "Study.of_cuts",
    "resume": "resume=True",
}
"""What an option is called in Python, where its name is another one."""


def as_arguments(sentence: str) -> str:
    """A sentence about options of the command line, for a reader who calls from Python.

    >>> as_arguments("give --force-col, or add --resume (option --t-end)")
    'give force_col, or add resume=True (argument t_end)'
    >>> as_arguments("give --food a file, which cutcal foods --template begins")
    'give food a file, which cutcal foods --template begins'
    """

    def named_in_python(option: re.Match[str]) -> str:
        if COMMAND.search(sentence, 0, option.start()):
            return option[0]
        return ARGUMENTS.get(option[1], option[1].replace("-", "_"))

    named = OPTION.sub(named_in_python, sentence)
    return re.sub(r"\boption (?=[a-z_]+\b)", "argument ", named) if named != sentence else sentence


def in_arguments(say: Callable[[str], None] | None) -> Callable[[str], None] | None:
    """The same listener, which hears of arguments in place of options; None for none."""
    if say is None:
        return None
    heard = say
    return lambda sentence: heard(as_arguments(sentence))


@contextmanager
def speaking_of_arguments() -> Iterator[None]:
    """Errors raised within name arguments of Python in place of options of the command line."""
    try:
        yield
    except CutcalError as e:
        if e.args and isinstance(e.args[0], str):
            e.args = (as_arguments(e.args[0]), *e.args[1:])
        raise
