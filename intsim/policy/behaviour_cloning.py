"""A behaviour-cloning policy: a small network that does what demonstrations did.

:mod:`intsim.policy.training` trains it. It is no vision-language-action model: it is given the place and size of the
food in numbers, and the words of the instruction as a bag. It must learn where the words want the cut, the way there,
and how far the edge is commanded. It sees where the edge is and was a step before, no force and no command, and gives
the next commanded poses in one piece (action chunking: Zhao et al. 2023, arXiv:2304.13705).
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calib.errors import OutputError
from intsim.task.gym_action import GRIPPER_CLOSED
from intsim.task.planner import HOME
from intsim.task.selection import TaskFilter, TrainingTasks
from intsim.task.targets import Item

ACTION_CHUNK = 8  # commanded poses in one piece: 0.4 s
LENGTH_SCALE = 0.1  # unit of the network's lengths [m]
STEP_SCALE = 0.01  # unit of its ways in a step [m]
MAX_STEPS = 240  # steps of an episode: 12 s
RETURN_DEPTH = 0.03  # below its height at home, at which the edge has come back [m]
TOKEN = re.compile(r"[a-z]+|\d+/\d+|\d+(?:\.\d+)?%?")


def tokens(sentence: str) -> list[str]:
    """Words and numbers of a sentence, in small letters."""
    return TOKEN.findall(sentence.lower())


def to_food_frame(pose: np.ndarray, item: Item) -> np.ndarray:
    """Poses as seen from a food.

    Args:
        pose: Poses x, y, z [m], yaw and tilt [rad], shape (..., 5).
        item: The food.

    Returns:
        Along and across the food and height [:data:`LENGTH_SCALE`], and cosine and sine of twice the angle between edge
        and axis [-], shape (..., 5).
    """
    offset = pose[..., :2] - [item.x, item.y]
    c, s = item.axis
    turn = 2 * (pose[..., 3] - item.yaw)  # an edge has no direction
    along, across = offset @ [c, s], offset @ [-s, c]
    return np.stack(
        [along / LENGTH_SCALE, across / LENGTH_SCALE, pose[..., 2] / LENGTH_SCALE, np.cos(turn), np.sin(turn)], axis=-1
    )


def from_food_frame(seen: np.ndarray, item: Item) -> np.ndarray:
    """Poses on the table from those of :func:`to_food_frame`, level.

    Args:
        seen: What that function returns, shape (..., 5) [-].
        item: The food.

    Returns:
        Poses x, y, z [m], yaw and tilt [rad], shape (..., 5).
    """
    c, s = item.axis
    along, across, z = (LENGTH_SCALE * seen[..., k] for k in range(3))
    yaw = item.yaw + np.arctan2(seen[..., 4], seen[..., 3]) / 2
    yaw = (yaw + math.pi / 2) % math.pi - math.pi / 2
    return np.stack([item.x + c * along - s * across, item.y + s * along + c * across, z, yaw, 0 * z], axis=-1)


def observed_features(pose: np.ndarray, before: np.ndarray, item: Item) -> np.ndarray:
    """What the network is given of a pose and a food, without the words.

    Args:
        pose: Poses of the edge x, y, z [m], yaw and tilt [rad], shape (..., 5).
        before: Those a step before [m, rad], shape (..., 5).
        item: The food.

    Returns:
        The pose in the food's frame, the way of the last step, and the food's size [-], shape (..., 13).
    """
    now, then = to_food_frame(pose, item), to_food_frame(before, item)
    size = np.array([item.shape.length, item.shape.width, item.shape.height]) / LENGTH_SCALE
    rest = np.broadcast_to(size, (*now.shape[:-1], 3))
    return np.concatenate([now, (now - then) * (LENGTH_SCALE / STEP_SCALE), rest], axis=-1)


@dataclass(eq=False)
class Clone:
    """A behaviour-cloning policy that was trained.

    Attributes:
        vocabulary: Words that it knows.
        weights: Of the layers: (matrix, vector) of each.
        about: What it was trained on.
    """

    vocabulary: tuple[str, ...]
    weights: list[tuple[np.ndarray, np.ndarray]]
    about: dict[str, Any]

    def __post_init__(self) -> None:
        self.reset(0)

    def reset(self, seed: int) -> None:
        """A new episode begins."""
        del seed
        self._todo: list[np.ndarray] = []
        self._before: np.ndarray | None = None
        self._steps, self._down = 0, False

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
        """The next change of pose; None when the edge has been down and is back up, or the time is over."""
        pose = np.asarray(obs["pose"], float)
        item = self._food(obs["items"], instruction)
        self._steps += 1
        self._down |= bool(pose[2] < item.shape.height)
        if self._steps > MAX_STEPS or (self._down and pose[2] > HOME[2] - RETURN_DEPTH):
            return None
        if not self._todo:
            before = pose if self._before is None else self._before
            given = np.concatenate([observed_features(pose, before, item), bag_of_words(instruction, self.vocabulary)])
            self._todo = list(from_food_frame(self._forward(given).reshape(ACTION_CHUNK, 5), item))
        self._before = pose
        goal = self._todo.pop(0)
        change = goal - pose
        turn = (change[3] + math.pi / 2) % math.pi - math.pi / 2
        return np.array([*change[:3], 0.0, change[4], turn, GRIPPER_CLOSED])

    def _forward(self, x: np.ndarray) -> np.ndarray:
        for k, (matrix, vector) in enumerate(self.weights):
            x = matrix @ x + vector
            if k < len(self.weights) - 1:
                x = np.maximum(x, 0.0)
        return x

    def _food(self, items: Sequence[Item], instruction: str) -> Item:
        """The food that is named, else the first."""
        said = set(tokens(instruction))
        return next((i for i in items if set(i.name.split("_")) <= said), items[0])

    @property
    def trained(self) -> TrainingTasks | None:
        """What it has learnt from; None for a file of an older version, which does not say."""
        if "foods" not in self.about:
            return None
        about = self.about
        return TrainingTasks(
            about["demos"], about["ratio"], about["side"], tuple(about["without"]), tuple(about["foods"])
        )

    @property
    def name(self) -> str:
        """What results call it: what it has learnt from."""
        about, trained = self.about, self.trained
        kind = about["keep"]
        if trained is not None:
            tasks = TaskFilter(trained.ratio, trained.side, trained.without).words()
            kind = ", ".join(filter(None, (kind, tasks, f"seed {about['seed']}" if about["seed"] else "")))
        return f"clone of {about['trajectories']} trajectories of {about['dataset']} ({kind})"

    def save(self, path: Path) -> None:
        """Write it as numbers (npz) with its vocabulary.

        Raises:
            OutputError: The file cannot be written.
        """
        arrays: dict[str, Any] = {}
        for k, layer in enumerate(self.weights):
            arrays |= {f"w{k}": layer[0], f"b{k}": layer[1]}
        about = json.dumps({"vocabulary": self.vocabulary, "about": self.about})
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("wb") as stream:
                np.savez(stream, about=np.array(about), **arrays)
        except OSError as e:
            raise OutputError(f"{path}: cannot be written ({e.strerror})") from None

    @staticmethod
    def load(path: Path) -> Clone:
        """A clone from its file.

        Raises:
            OutputError: The file is missing or holds something else.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                found = json.loads(str(file["about"]))
                layers = sum(name.startswith("w") for name in file.files)
                weights = [(file[f"w{k}"], file[f"b{k}"]) for k in range(layers)]
        except (OSError, KeyError, ValueError) as e:
            raise OutputError(f"{path}: not a trained clone ({e}); make one with cutcal dataset clone") from None
        return Clone(tuple(found["vocabulary"]), weights, found["about"])


def bag_of_words(sentence: str, vocabulary: Sequence[str]) -> np.ndarray:
    """Which words of a vocabulary a sentence has, shape (v,)."""
    said = set(tokens(sentence))
    return np.array([float(word in said) for word in vocabulary])
