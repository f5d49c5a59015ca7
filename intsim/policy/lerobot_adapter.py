"""A policy of LeRobot's (ACT, Diffusion Policy, SmolVLA, pi0 and others) as a server of :mod:`intsim.policy.remote`.

    python -m intsim.policy.vla_adapters lerobot --weights runs/act/checkpoints/last/pretrained_model --device cpu
    cutcal evaluate --policy remote --server http://127.0.0.1:8000 --world intsim --pixels 128

LeRobot loads it, prepares what it is given, asks it and scales its actions back, as in its own evaluation
(``lerobot-eval``). It is asked once in every step, with that step's pictures: what it remembers, and how many actions
of a chunk it carries out, is its own affair. It has to have learnt from an export of ``cutcal dataset``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from intsim.task.gym_action import from_gym_action, policy_state
from mpm.scene.errors import CutcalError

PICTURE, STATE = "observation.images.", "observation.state"
STATE_SIZE, ACTION_SIZE = 8, 7  # numbers of a state and of an action of the exports


class LeRobotPolicy:
    """A policy of LeRobot's.

    Args:
        weights: Folder or name of a trained policy, with its processors.
        device: Of the network.

    Raises:
        CutcalError: It looks at something else, or gives something else, than an export has.
    """

    action = "pose"

    def __init__(self, weights: str, device: str = "cuda:0") -> None:
        import torch
        from lerobot.configs import PreTrainedConfig
        from lerobot.policies.factory import get_policy_class, make_pre_post_processors

        self._torch = torch
        config = PreTrainedConfig.from_pretrained(weights)
        config.device = device
        self.name = f"lerobot {config.type}"
        self._pixels = _pictures(weights, config)
        self.cameras: Sequence[str] = tuple(self._pixels)
        self.network = get_policy_class(config.type).from_pretrained(weights, config=config)
        self.network.to(device).eval()
        self.before, self.after = make_pre_post_processors(
            config, pretrained_path=weights, preprocessor_overrides={"device_processor": {"device": device}}
        )

    def reset(self, seed: int, instruction: str) -> None:
        """Forget what was seen, and what of a chunk was not done yet."""
        self._torch.manual_seed(seed)
        for part in (self.network, self.before, self.after):
            part.reset()

    def act(
        self, instruction: str, pose: np.ndarray, joints: np.ndarray | None, images: dict[str, np.ndarray]
    ) -> np.ndarray:
        """Ask for the action of this step.

        Args:
            instruction: What is asked for, in words.
            pose: Pose of the edge x, y, z [m], yaw and tilt [rad], shape (5,).
            joints: Arm and fingers [rad, m], shape (9,); not used.
            images: Pictures by camera, from 0 to 255 [-], shape (h, w, 3) each.

        Returns:
            Change of pose [m, rad] and gripper, shape (1, 7).

        Raises:
            ValueError: Pictures are of another size than those that it has learnt from.
        """
        from lerobot.envs.utils import preprocess_observation

        for name, shape in self._pixels.items():
            if images[name].shape[:2] != shape:
                raise ValueError(
                    f"pictures of {images[name].shape[1]} x {images[name].shape[0]} pixels, and it has learnt from "
                    f"{shape[1]} x {shape[0]}: evaluate it with --pixels {shape[0]}"
                )
        seen = preprocess_observation(
            {
                "pixels": {name: np.array(images[name])[None] for name in self.cameras},
                "agent_pos": policy_state(pose).astype(np.float32)[None],
            }
        )
        with self._torch.inference_mode():
            chosen = self.network.select_action(self.before({**seen, "task": [instruction]}))
        found = self.after(chosen).to("cpu").numpy()
        return from_gym_action(np.asarray(found, float).reshape(1, ACTION_SIZE), float(pose[3]))


def _pictures(weights: str, config: Any) -> dict[str, tuple[int, int]]:
    """Height and width of the pictures that a policy looks at [px], by camera.

    Raises:
        CutcalError: It looks at something else, or gives something else, than an export has.
    """
    given = {name: tuple(feature.shape) for name, feature in config.input_features.items()}
    made = {name: tuple(feature.shape) for name, feature in config.output_features.items()}
    pictures = {name: shape for name, shape in given.items() if name.startswith(PICTURE)}
    other = {name: shape for name, shape in given.items() if name not in pictures}
    if other not in ({}, {STATE: (STATE_SIZE,)}) or made != {"action": (ACTION_SIZE,)}:
        raise CutcalError(
            f"lerobot: --weights {weights}: takes {other} beside pictures and gives {made}; a policy that learnt from "
            f"an export of cutcal dataset takes {STATE} ({STATE_SIZE},) and gives action ({ACTION_SIZE},)"
        )
    return {name[len(PICTURE) :]: (shape[1], shape[2]) for name, shape in pictures.items()}
