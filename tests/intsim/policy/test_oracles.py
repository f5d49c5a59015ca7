"""What the built-in policies send, beside where they move the edge."""

from __future__ import annotations

import io

import h5py
import numpy as np
import pytest

from calib.material.food import load_food
from intsim.data.shards import pack_episode
from intsim.policy.behaviour_cloning import ACTION_CHUNK, Clone
from intsim.policy.oracles import POLICIES, make_policy
from intsim.task.kinematic_table import KinematicTable
from intsim.task.suites import FIRST_TEST_SEED, sample_episode
from tests.intsim.data.test_generate import track


@pytest.mark.parametrize("name", [*POLICIES, "clone"])
def test_every_action_closes_the_gripper_as_the_demonstrations_do(name):
    """ManiSkill's Panda closes its gripper at -1 and holds the fingers 15 mm apart at 0: a policy that sends another
    number than the dataset stores takes its hand off the knife that the dataset holds.
    """
    with h5py.File(io.BytesIO(pack_episode(track(), {}, {}))) as file:
        stored = set(file["control/delta"][:, 6].tolist())
    episode = sample_episode("seeds", FIRST_TEST_SEED, {"orange": load_food("orange")})
    table = KinematicTable([episode.item])
    clone = Clone(("cut",), [(np.zeros((5 * ACTION_CHUNK, 14)), np.full(5 * ACTION_CHUNK, 0.1))], {})
    policy = clone if name == "clone" else make_policy(name)
    policy.reset(0)
    action = policy.act(table.observe(), episode.instruction)
    assert action is not None and action.shape == (7,)
    assert stored == {action[6]} == {-1.0}
