"""LeRobot's own code behind the protocol: a small random policy is asked as ``lerobot-eval`` asks it. Needs LeRobot
0.6.1 (Python 3.12), which is not among the extras: its tests are marked ``vla``. Where LeRobot, NumPy and pytest alone
are installed, ``python -m pytest --noconftest -o addopts=--import-mode=importlib`` runs this file."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import intsim
from intsim.policy.remote import Remote
from intsim.policy.server import Server
from intsim.task.gym_action import from_gym_action, policy_state
from mpm.scene.errors import CutcalError

PIXELS, CAMERAS = 64, ("front", "wrist")
POSE = np.array([0.1, -0.05, 0.2, 0.4, 0.1])


def test_adapters_need_no_more_than_numpy():
    """They run in environments of others: what importing them brings along is NumPy and this project's own modules,
    none of which needs more."""
    code = (
        "import sys\n"
        f"sys.path.insert(0, {str(Path(intsim.__file__).parents[1])!r})\n"
        "before = set(sys.modules)\n"
        "import intsim.policy.vla_adapters\n"
        "print(*{name.split('.')[0] for name in set(sys.modules) - before} - set(sys.stdlib_module_names))"
    )
    found = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True)
    named = {name for name in found.stdout.split() if not name.startswith("_")}
    assert {"intsim", "numpy"} <= named <= {"calib", "cython_runtime", "intsim", "mpm", "numpy"}


def test_a_policy_is_given_the_state_that_it_learnt_from():
    """Its numbers are those of a demonstration's step, row by row: place, roll, tilt, yaw, pad, closed gripper."""
    assert policy_state(POSE) == pytest.approx([0.1, -0.05, 0.2, 0, 0.1, 0.4, 0, -1])
    assert policy_state(np.stack([POSE, 2 * POSE]))[1] == pytest.approx([0.2, -0.1, 0.4, 0, 0.2, 0.8, 0, -1])


@pytest.mark.parametrize(
    ("given", "made"),
    [({"observation.environment_state": (3,)}, (7,)), ({"observation.state": (6,)}, (7,)), ({}, (14,))],
)
def test_a_policy_of_another_robot_is_refused(given, made):
    """One that takes or gives what no export has is one line that says what it should be."""
    from intsim.policy.lerobot_adapter import _pictures

    def features(shapes):
        return {name: SimpleNamespace(shape=shape) for name, shape in shapes.items()}

    config = SimpleNamespace(
        input_features=features({"observation.images.front": (3, 8, 8), **given}),
        output_features=features({"action": made}),
    )
    with pytest.raises(CutcalError, match=r"learnt from an export of cutcal dataset takes observation.state \(8,\)"):
        _pictures("w", config)


@pytest.fixture(scope="module")
def act(tmp_path_factory):
    """A folder with a random ACT of a few thousand weights and its processors, as LeRobot's training leaves them."""
    torch = pytest.importorskip("torch", reason="LeRobot is not installed")
    pytest.importorskip("lerobot", reason="LeRobot is not installed")
    from lerobot.configs import FeatureType, PolicyFeature
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors

    torch.manual_seed(0)
    pictures = {f"observation.images.{name}": (3, PIXELS, PIXELS) for name in CAMERAS}
    config = ACTConfig(
        input_features={
            **{name: PolicyFeature(FeatureType.VISUAL, shape) for name, shape in pictures.items()},
            "observation.state": PolicyFeature(FeatureType.STATE, (8,)),
        },
        output_features={"action": PolicyFeature(FeatureType.ACTION, (7,))},
        device="cpu",
        pretrained_backbone_weights=None,
        chunk_size=4,
        n_action_steps=3,
        dim_model=32,
        n_heads=2,
        dim_feedforward=32,
        n_encoder_layers=1,
        n_vae_encoder_layers=1,
        latent_dim=4,
    )
    rng = torch.Generator().manual_seed(1)
    stats = {name: {"mean": torch.full((3, 1, 1), 0.4), "std": torch.full((3, 1, 1), 0.2)} for name in pictures}
    for name, size in (("observation.state", 8), ("action", 7)):
        stats[name] = {"mean": torch.rand(size, generator=rng), "std": 0.5 + torch.rand(size, generator=rng)}
    folder = tmp_path_factory.mktemp("act")
    ACTPolicy(config).save_pretrained(folder)
    for part in make_pre_post_processors(config, dataset_stats=stats):
        part.save_pretrained(folder)
    return folder


def seen(step: int) -> dict[str, np.ndarray]:
    """Pictures of a step."""
    rng = np.random.default_rng(step)
    return {name: rng.integers(0, 256, (PIXELS, PIXELS, 3), np.uint8) for name in CAMERAS}


@pytest.mark.vla
def test_its_actions_are_those_of_lerobots_own_evaluation(act):
    """Step by step through the protocol, two chunks long: what LeRobot's functions, called as its ``rollout`` calls
    them, give for the same pictures and state, brought to metres and radians. A new episode begins a new chunk."""
    import torch
    from lerobot.envs.utils import preprocess_observation
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors

    from intsim.policy.lerobot_adapter import LeRobotPolicy

    own = ACTPolicy.from_pretrained(act)
    before, after = make_pre_post_processors(own.config, pretrained_path=act)
    server = Server(LeRobotPolicy(str(act), "cpu"), port=0)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        policy = Remote(f"http://127.0.0.1:{server.server_port}")
        assert policy.name == "lerobot act" and policy.cameras == list(CAMERAS)
        for episode in range(2):
            policy.reset(episode)
            own.reset()
            firsts = []
            for step in range(5 if episode else 7):
                images, pose = seen(10 * episode + step), POSE * (1 + 0.1 * step)
                given = preprocess_observation(
                    {
                        "pixels": {name: image[None] for name, image in images.items()},
                        "agent_pos": policy_state(pose).astype(np.float32)[None],
                    }
                )
                with torch.inference_mode():
                    wanted = after(own.select_action(before({**given, "task": ["cut the plum"]})))
                found = policy.act({"pose": pose, "images": images}, "cut the plum")
                assert found == pytest.approx(from_gym_action(wanted.numpy().astype(float)[0], pose[3]), abs=1e-6)
                firsts.append(found)
            assert np.ptp(firsts, axis=0).max() > 1e-3, "it does not see its pictures"
        policy.reset(0)
        small = {name: image[::2, ::2] for name, image in seen(0).items()}
        with pytest.raises(CutcalError, match="evaluate it with --pixels 64"):
            policy.act({"pose": POSE, "images": small}, "cut the plum")
    finally:
        server.shutdown()
        server.server_close()
