"""Cutting tasks in words, and words back into tasks.

A small grammar: templates with slots for ratio, food and side, each filled from a pool of words that mean the same.
Templates for training and those that a policy has never seen are disjoint. Every sentence that is made can be read back
into its task.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

import numpy as np

from intsim.task.targets import CutSpec, TaskError

T = TypeVar("T")
SENTENCES_PER_TASK = 5
"""Sentences for each trajectory, at least."""
TRAINING_TEMPLATES = (
    "cut {ratio} of the {item} {side}",
    "cut the {item} at {ratio} {side}",
    "slice {ratio} off the {item} {side}",
    "take the knife and cut {ratio} off the {item} {side}",
    "separate {ratio} of the {item} {side}",
    "with the knife, cut off {ratio} of the {item}, measured {side}",
)
TEST_TEMPLATES = (
    "please remove {ratio} of the {item} {side}",
    "I would like {ratio} of the {item} cut away {side}",
    "bring the blade down on the {item} at {ratio} {side}",
    "chop {ratio} from the {item}, counting {side}",
    "part the {item} so that {ratio} comes off {side}",
)
TRAINING_PIECES_TEMPLATES = (
    "divide the {item} into {count} equal pieces",
    "cut the {item} into {count} equal parts",
    "slice the {item} into {count} pieces of the same size",
    "split the {item} into {count} equal pieces with the knife",
    "make {count} equal pieces of the {item}",
)
TEST_PIECES_TEMPLATES = (
    "portion the {item} evenly for {count} people",
    "I need {count} equal portions of the {item}",
    "chop up the {item} so that there are {count} even parts",
    "share the {item} out into {count} like parts",
    "turn the {item} into {count} identical chunks",
)
SIDE_PHRASES = {
    "left": ("from the left", "from the left end", "on the left side", "starting at the left"),
    "right": ("from the right", "from the right end", "on the right side", "starting at the right"),
    "centre": ("in the middle", "at the centre", "right through the middle", "across its middle"),
}
NUMBER_WORDS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
FRACTION_WORDS = {
    2: "half",
    3: "third",
    4: "quarter",
    5: "fifth",
    6: "sixth",
    7: "seventh",
    8: "eighth",
    9: "ninth",
    10: "tenth",
}
FOOD_SYNONYMS = {"shine_muscat": ("shine muscat", "shine muscat grape"), "kiwi": ("kiwi", "kiwifruit")}
"""Other words for a food; the others go by their names."""


def words_of_item(name: str) -> tuple[str, ...]:
    """Words for a food."""
    return FOOD_SYNONYMS.get(name, (name.replace("_", " "),))


def words_of_ratio(ratio: Fraction | float) -> tuple[str, ...]:
    """Words for a part of a food: of a Fraction its words, digits and multiples, of another number its digits."""
    if not isinstance(ratio, Fraction):
        return (f"{ratio:.2f}", f"{100 * ratio:.0f}%", f"{100 * ratio:.0f} percent")
    n, d = ratio.numerator, ratio.denominator
    out = [f"{n}/{d}"]
    if 100 % d == 0:
        out += [f"{100 * n // d}%", f"{100 * n // d} percent"]
    if d in FRACTION_WORDS and n < len(NUMBER_WORDS):
        plural = {"half": "halves"}.get(FRACTION_WORDS[d], FRACTION_WORDS[d] + "s")
        if n == 1:
            out += [f"one {FRACTION_WORDS[d]}", "half" if d == 2 else f"a {FRACTION_WORDS[d]}"]
        else:
            out.append(f"{NUMBER_WORDS[n]} {plural}")
    for k in (2, 3):
        if k * n < len(NUMBER_WORDS) and k * d in FRACTION_WORDS:
            out.append(f"{NUMBER_WORDS[k * n]} {FRACTION_WORDS[k * d]}s")
    return tuple(out)


def words_of_count(count: int) -> tuple[str, ...]:
    """Words for a number of pieces."""
    return (NUMBER_WORDS[count], str(count)) if count < len(NUMBER_WORDS) else (str(count),)


def templates_of(spec: CutSpec, *, unseen: bool = False) -> tuple[str, ...]:
    """Templates for a kind of task: those of training, or with ``unseen`` those that are kept for testing."""
    if spec.pieces:
        return TEST_PIECES_TEMPLATES if unseen else TRAINING_PIECES_TEMPLATES
    return TEST_TEMPLATES if unseen else TRAINING_TEMPLATES


def sentences(spec: CutSpec, *, unseen: bool = False) -> Iterator[str]:
    """All sentences for a task, those of the templates that are kept for testing with ``unseen``."""
    for template in templates_of(spec, unseen=unseen):
        for item in words_of_item(spec.item):
            if spec.pieces:
                for count in words_of_count(spec.pieces):
                    yield template.format(item=item, count=count)
                continue
            for ratio in words_of_ratio(spec.ratio):
                for side in SIDE_PHRASES[spec.side]:
                    yield template.format(item=item, ratio=ratio, side=side)


def instructions(spec: CutSpec, seed: int, count: int = SENTENCES_PER_TASK, *, unseen: bool = False) -> list[str]:
    """Different sentences for a task, drawn from templates in turn.

    Args:
        spec: The task.
        seed: Of the choice.
        count: How many.
        unseen: From the templates that are kept for testing.

    Returns:
        As many sentences, no two the same.

    Raises:
        TaskError: There are not as many.
    """
    pool: dict[str, list[str]] = {}
    templates = templates_of(spec, unseen=unseen)
    all_of_them = list(sentences(spec, unseen=unseen))
    for k, template in enumerate(templates):
        part = len(all_of_them) // len(templates)
        pool[template] = all_of_them[k * part : (k + 1) * part]
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(templates))
    out: list[str] = []
    while len(out) < count and any(pool.values()):
        for k in order:
            left = pool[templates[k]]
            if left and len(out) < count:
                out.append(left.pop(int(rng.integers(len(left)))))
    if len(out) < count:
        raise TaskError(f"task: only {len(out)} sentences for it, {count} are asked for")
    return out


def parse_instruction(sentence: str, items: Sequence[str], camera: str = "front") -> CutSpec:
    """The task that a sentence asks for.

    Args:
        sentence: Made by this grammar, or in its words.
        items: Names of the foods that may be meant.
        camera: Name of the camera for left and right.

    Returns:
        The task.

    Raises:
        TaskError: A food, ratio or side that is not said, or said in two ways.
    """
    text = " " + re.sub(r"[,.!?]+(?=\s|$)", " ", sentence.lower()) + " "
    named: set[str] = set()
    for word, name in sorted(((w, n) for n in items for w in words_of_item(n)), key=lambda pair: -len(pair[0])):
        if f" {word} " in text:  # the longest words first: a shine muscat grape is no grape
            named.add(name)
            text = text.replace(f" {word} ", " # ")
    item = _only("food", sentence, named)
    if not re.search(r"\b(left|right|middle|cent(re|er))\b", text):
        counts = {n for n in range(2, 100) for w in words_of_count(n) if f" {w} " in text}
        if counts:
            return CutSpec(item, camera=camera, pieces=_only("number of pieces", sentence, counts))
    side = _only("side", sentence, {s for s, words in SIDE_PHRASES.items() if any(f" {w} " in text for w in words)})
    for words in SIDE_PHRASES.values():
        for word in sorted(words, key=len, reverse=True):
            text = text.replace(f" {word} ", " # ")
    return CutSpec(item, _only("ratio", sentence, _ratios(text)), side, camera)


def _ratios(text: str) -> set[Fraction | float]:
    """Parts that a text names."""
    found: set[Fraction | float] = {Fraction(int(a), int(b)) for a, b in re.findall(r" (\d+)/([1-9]\d*) ", text)}
    for digits in re.findall(r" (\d+)\s?(?:%|percent) ", text):
        found.add(Fraction(int(digits), 100))
    found |= {float(digits) for digits in re.findall(r" (0\.\d+) ", text)}
    for d, part in FRACTION_WORDS.items():
        plural = "halves" if part == "half" else part + "s"
        for n, number in enumerate(NUMBER_WORDS):
            if n > 0 and (f" {number} {plural if n > 1 else part} " in text):
                found.add(Fraction(n, d))
        if f" a {part} " in text or (d == 2 and re.search(r"(?<!one) half ", text)):
            found.add(Fraction(1, d))
    return found


def _only(what: str, sentence: str, found: set[T]) -> T:
    if len(found) != 1:
        said = "says no" if not found else f"says {len(found)} of"
        raise TaskError(f"task: {sentence!r} {said} {what}")
    return found.pop()


def read_paraphrases(path: Path | str, spec: CutSpec, items: Sequence[str]) -> list[str]:
    """Read somebody else's sentences for a task; those that the grammar cannot read are taken on trust.

    Args:
        path: Text file with a sentence a line.
        spec: The task.
        items: Names of the foods that may be meant.

    Returns:
        The sentences.

    Raises:
        TaskError: The file cannot be read, or a line that the grammar reads means another task.
    """
    try:
        lines = [line.strip() for line in Path(path).read_text(encoding="utf-8").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as e:
        raise TaskError(f"{path}: cannot be read as text ({e})") from None
    for k, line in enumerate(lines, 1):
        try:
            meant = parse_instruction(line, items, spec.camera)
        except TaskError:
            continue
        if not same_task(meant, spec):
            raise TaskError(f"{path}, line {k}: {line!r} asks for another cut")
    return lines


def same_task(a: CutSpec, b: CutSpec) -> bool:
    """Whether two tasks are the same: a ratio that was said with two digits is the one that it rounds."""
    close = abs(float(a.ratio) - float(b.ratio)) < 0.005 + 1e-9
    return close and replace(a, ratio=b.ratio) == b
