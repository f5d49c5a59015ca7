"""Backgrounds are drawn from their number, without a simulator."""

from __future__ import annotations

import numpy as np
import pytest

from intsim.render.background import BACKGROUNDS, Background
from intsim.task.targets import TaskError


def test_a_background_is_drawn_from_its_number_alone():
    """The same number gives the same colours and light, another number others; all colours are between 0 and 1."""
    every = [Background.of(k) for k in range(BACKGROUNDS)]
    for one in every:
        again = Background.of(one.number)
        assert np.array_equal(one.table, again.table) and np.array_equal(one.direction, again.direction)
        assert one.strength == again.strength and one.direction[2] < 0
        assert all(((0 < c) & (c < 1)).all() for c in (one.table, one.board, one.wall))
    assert len({tuple(one.board) for one in every}) == BACKGROUNDS


@pytest.mark.parametrize("number", [-1, BACKGROUNDS])
def test_a_background_that_does_not_exist_is_an_error(number):
    """In one line that says which there are."""
    with pytest.raises(TaskError, match="0 to 14"):
        Background.of(number)
