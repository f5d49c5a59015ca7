"""Sentences for tasks and back."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intsim.task.language import (
    TEST_TEMPLATES,
    TRAINING_TEMPLATES,
    instructions,
    parse_instruction,
    read_paraphrases,
    same_task,
    sentences,
)
from intsim.task.suites import FOODS
from intsim.task.targets import CutSpec, TaskError

RATIOS = [
    Fraction(1, 2),
    Fraction(1, 3),
    Fraction(1, 4),
    Fraction(1, 6),
    Fraction(2, 3),
    Fraction(3, 4),
    Fraction(5, 6),
]
specs = st.one_of(
    st.builds(CutSpec, st.sampled_from(FOODS), st.sampled_from(RATIOS), st.sampled_from(["left", "right"])),
    st.builds(CutSpec, st.sampled_from(FOODS)),
    st.builds(CutSpec, st.sampled_from(FOODS), st.floats(0.1, 0.9).map(lambda r: round(r, 2)), st.just("left")),
    st.builds(CutSpec, st.sampled_from(FOODS), pieces=st.integers(2, 8)),
)


@settings(max_examples=60, deadline=None)
@given(specs, st.booleans())
def test_every_sentence_is_read_back_as_its_task(spec, unseen):
    """Whatever the grammar says of a task, among all foods, means that task."""
    for sentence in sentences(spec, unseen=unseen):
        assert same_task(parse_instruction(sentence, FOODS), spec), sentence


@settings(max_examples=40, deadline=None)
@given(specs, st.integers(0, 1000))
def test_five_different_sentences_that_repeat_with_their_seed(spec, seed):
    """At least five for each trajectory, in training and in test, and none of the test's in training."""
    training, test = (instructions(spec, seed, unseen=unseen) for unseen in (False, True))
    assert len(set(training)) == len(set(test)) == 5
    assert training == instructions(spec, seed)
    assert not set(sentences(spec)) & set(sentences(spec, unseen=True))


def test_ratios_have_words_digits_and_multiples():
    """A half is also 50% and two quarters."""
    said = " | ".join(sentences(CutSpec("apple")))
    for words in ("cut half of", "cut 50% of", "cut two quarters of", "cut 1/2 of", "cut one half of"):
        assert words in said
    assert len(TRAINING_TEMPLATES) == len(set(TRAINING_TEMPLATES)) and not set(TRAINING_TEMPLATES) & set(TEST_TEMPLATES)


@pytest.mark.parametrize(
    ("sentence", "says"),
    [
        ("cut a quarter of the stone from the left", "no food"),
        ("cut the banana from the left", "no ratio"),
        ("cut a quarter of the banana", "no side"),
        ("cut a quarter and a third of the banana from the left", "2 of ratio"),
        ("cut a quarter of the banana and the apple from the left", "2 of food"),
    ],
)
def test_what_is_not_said_is_not_guessed(sentence, says):
    """A task is refused with what is missing or said twice."""
    with pytest.raises(TaskError, match=says):
        parse_instruction(sentence, FOODS)


def test_paraphrases_are_taken_from_a_file(tmp_path):
    """Free words are taken as they are, but a line that the grammar reads as another cut is refused with its number."""
    spec = CutSpec("banana", Fraction(1, 4), "left")
    file = tmp_path / "words.txt"
    file.write_text("lop the left quarter of the fruit off\n\ncut a quarter of the banana from the left\n")
    assert len(read_paraphrases(file, spec, FOODS)) == 2
    file.write_text("cut a quarter of the banana from the left\ncut a third of the banana from the left\n")
    with pytest.raises(TaskError, match="line 2.*another cut"):
        read_paraphrases(file, spec, FOODS)
    with pytest.raises(TaskError, match="cannot be read"):
        read_paraphrases(tmp_path / "none.txt", spec, FOODS)
