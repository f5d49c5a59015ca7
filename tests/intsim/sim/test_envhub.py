"""CutFood-v1 as LeRobot's evaluation expects an environment: in Gymnasium's terms where the extra ``[robot]`` is
installed, and loaded and rolled out by LeRobot's own functions where LeRobot 0.6.1 is too (marked ``vla``). LeRobot's
hub is not reached: the file is taken from the checkout where it would be downloaded."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mani_skill", reason="the extra [robot] is not installed")

from gymnasium.utils.env_checker import check_env

from calib.material.food import load_food
from intsim.data.cameras import CAMERA_NAMES
from intsim.policy.oracles import make_policy
from intsim.sim import envhub, world
from intsim.sim.envhub import CutFood, make_env
from intsim.task.gym_action import policy_state, to_gym_action
from intsim.task.suites import FIRST_TEST_SEED, sample_episode
from intsim.task.suites import FOODS as NAMES
from mpm.scene.errors import CutcalError

FOODS, FIFTEEN = {"cherry": load_food("cherry")}, {name: load_food(name) for name in NAMES}
SMALL = {"pixels": 32, "foods": FOODS}


def planned(policy, env: CutFood) -> np.ndarray:
    """The next action of an oracle that knows the foods; it stays where it is at the end of its plan."""
    inner = env._inner
    found = policy.act({"pose": inner.pose, "items": tuple(inner.coupling.items)}, env.task_description)
    return to_gym_action(np.zeros(7) if found is None else found, inner.pose[3]).astype(np.float32)


@pytest.fixture(scope="module")
def env():
    """One environment, of cherries."""
    made = CutFood(**SMALL)
    yield made
    made.close()


def test_it_keeps_gymnasiums_rules(env):
    """Spaces, types, seeds and repetition, as Gymnasium's own checker looks for them."""
    check_env(env, skip_render_check=True)


def test_a_policy_is_given_what_an_export_has(env):
    """Pictures of the export's cameras and its state of the edge; the sentence is that of the test's task, whatever
    LeRobot counts its seeds from, and without a seed one of the tests is drawn."""
    seen, info = env.reset(seed=7)
    assert seen in env.observation_space and list(seen["pixels"]) == list(CAMERA_NAMES)
    assert seen["agent_pos"] == pytest.approx(policy_state(env._inner.pose), abs=1e-6) and info == {"is_success": False}
    task = sample_episode("seeds", FIRST_TEST_SEED + 7, FOODS)
    assert env._inner.episode == task and env.task_description == task.instruction and env.task == "seeds"
    shown = env._inner.pictures()
    assert all(np.array_equal(seen["pixels"][name], shown[name]) for name in seen["pixels"])
    assert np.array_equal(env.render(), shown["work"]) and np.ptp(env.render()) > 50
    env.reset()
    assert env._inner.episode.seed >= FIRST_TEST_SEED
    with pytest.raises(CutcalError, match="suite 'seed': none of seeds"):
        CutFood("seed")


@pytest.mark.slow
def test_a_cut_that_parts_the_food_succeeds_and_ends_the_episode(env):
    """An oracle's actions, sent as a policy's that learnt from an export: no success before the end, then one."""
    policy = make_policy("overdrive", 0.0)
    policy.reset(0)
    env.reset(seed=0)
    for _ in range(env._max_episode_steps):
        _, reward, over, late, info = env.step(planned(policy, env))
        assert info["is_success"] == over == (reward == 1.0) and not late
        if over:
            break
    assert over and info["severed"] and info["published"] and info["uncut"] < 0.05 and not info["broken"]


def test_nothing_is_cut_and_the_time_is_out(env):
    """A policy that stays where it is: no success, and the last of all steps is truncated."""
    env.reset(seed=0)
    still = np.array([0, 0, 0, 0, 0, 0, -1], np.float32)
    ends = [env.step(still)[2:4] for _ in range(env._max_episode_steps)]
    assert ends == [(False, False)] * (len(ends) - 1) + [(False, True)]


@pytest.mark.slow
def test_environments_come_by_suite():
    """That of the configuration, or the one that is named; each environment has a task of its own."""
    cfg = type("Config", (), {"task": "flips"})()
    envs = make_env(2, cfg=cfg, **SMALL)
    (vector,) = envs["flips"].values()
    seen, _ = vector.reset(seed=[3, 4])
    words = vector.call("task_description")
    vector.close()
    assert list(envs) == ["flips"] and list(envs["flips"]) == [0] and seen["agent_pos"].shape == (2, 8)
    assert list(words) == [sample_episode("flips", FIRST_TEST_SEED + k, FOODS).instruction for k in (3, 4)]


@pytest.mark.vla
@pytest.mark.slow
def test_lerobot_loads_it_and_counts_its_successes(monkeypatch):
    """LeRobot's ``make_env`` and the ``rollout`` of its evaluation, on the file as it would be downloaded.

    Of two tasks a policy plays an oracle's actions back in the first and stays where it is in the second. The first
    succeeds, with its last action, the second does not. The policy is given pictures and state under LeRobot's names,
    and the sentences.
    """
    torch = pytest.importorskip("torch", reason="LeRobot is not installed")
    pytest.importorskip("lerobot.datasets", reason="LeRobot's extra [dataset] is not installed", exc_type=ImportError)
    from lerobot.envs import close_envs, utils
    from lerobot.envs import make_env as lerobots
    from lerobot.processor import PolicyProcessorPipeline
    from lerobot.scripts.lerobot_eval import rollout

    seeds = [
        next(k for k in range(1000) if sample_episode("seeds", FIRST_TEST_SEED + k, FIFTEEN).item.name == "cherry")
    ]
    seeds.append(seeds[0] + 1)
    tasks = [sample_episode("seeds", FIRST_TEST_SEED + k, FIFTEEN) for k in seeds]
    actions = recorded(seeds[0])
    still = np.array([0, 0, 0, 0, 0, 0, -1], np.float32)

    class Playback(torch.nn.Module):
        """The oracle's actions in the first environment, none in the second."""

        def reset(self) -> None:
            """Nothing was asked yet."""
            self.asked: list = []

        def select_action(self, batch):
            """The next ones."""
            self.asked.append({name: getattr(v, "shape", v) for name, v in batch.items()})
            k = len(self.asked) - 1
            return torch.tensor(np.stack([actions[k] if k < len(actions) else still, still]))

    monkeypatch.setattr(world, "EPISODE_STEPS", len(actions) + 5)
    monkeypatch.setattr(utils, "hf_hub_download", lambda **asked: envhub.__file__)
    made = lerobots("user/cutfood", n_envs=2, use_async_envs=True, trust_remote_code=True)
    before, after = (PolicyProcessorPipeline(steps=[]) for _ in range(2))
    policy = Playback()
    try:
        found = rollout(made["seeds"][0], policy, before, after, lambda seen: seen, lambda chosen: chosen, seeds=seeds)
    finally:
        close_envs(made)
    success, done = found["success"].numpy(), found["done"].numpy()
    end = done[0].argmax()
    assert success[0, : end + 1].tolist() == [False] * end + [True] and end < len(actions)
    assert not success[1].any() and done[1].tolist() == [False] * (done.shape[1] - 1) + [True]
    given = policy.asked[0]
    pictures = {f"observation.images.{name}": (2, 3, 128, 128) for name in CAMERA_NAMES}
    wanted = {**pictures, "observation.state": (2, 8), "task": [task.instruction for task in tasks]}
    assert {name: given[name] if name == "task" else tuple(given[name]) for name in wanted} == wanted


def recorded(seed: int) -> list[np.ndarray]:
    """Actions of an oracle that parts the food of a task."""
    env, policy, out, over = CutFood(pixels=32), make_policy("overdrive", 0.0), [], False
    policy.reset(0)
    env.reset(seed=seed)
    while not over and len(out) < env._max_episode_steps:
        out.append(planned(policy, env))
        over = env.step(out[-1])[2]
    env.close()
    assert over, "the oracle does not succeed"
    return out
