"""Training of a behaviour-cloning policy on a dataset; needs the extra ``[robot]`` (torch)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.errors import OutputError
from intsim.data.shards import StoredTrajectory, is_kept, stored_item, trajectories
from intsim.policy.behaviour_cloning import (
    ACTION_CHUNK,
    Clone,
    bag_of_words,
    observed_features,
    to_food_frame,
    tokens,
)
from intsim.task.selection import EVERY_TASK, TaskFilter
from intsim.task.targets import TaskError

HIDDEN_WIDTH, LAYER_COUNT = 256, 3
TRAINING_STEPS, BATCH_SIZE, LEARNING_RATE = 4000, 256, 1e-3  # Adam with a rate that falls to nothing (cosine)


def train(
    folder: Path,
    *,
    keep: str = "severed",
    tasks: TaskFilter = EVERY_TASK,
    most: int | None = None,
    seed: int = 0,
) -> Clone:
    """Train a clone on the trajectories of a dataset.

    Args:
        folder: The dataset.
        keep: Which trajectories: those that meet the ``published`` criteria, those in pieces too (``severed``), or
            ``all``.
        tasks: Which tasks: one ratio, one side, a food left out.
        most: Of those, at most so many.
        seed: Of weights and batches.

    Returns:
        The policy; ``about`` says what it was trained on, and its error.

    Raises:
        OutputError: There is no dataset, or torch is not installed.
        TaskError: None of its trajectories is kept.
    """
    try:
        import torch
    except ImportError:
        raise OutputError("dataset clone: torch is not installed; pip install 'cutcal[robot]'") from None
    examples = _examples(folder, keep, tasks, most)
    vocabulary = tuple(sorted({word for group in examples.sentences for s in group for word in tokens(s)}))
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        weights, loss = _fit(examples, vocabulary, seed)
    finally:
        torch.set_num_threads(before)
    about = {
        "dataset": folder.name,
        "keep": keep,
        "trajectories": len(examples.sentences),
        "steps": TRAINING_STEPS,
        "seed": seed,
        "loss": loss,
        "demos": examples.demos.pop() if len(examples.demos) == 1 else None,
        "ratio": tasks.ratio,
        "side": tasks.side,
        "without": list(tasks.without),
        "foods": sorted(examples.foods),
    }
    return Clone(vocabulary, weights, about)


@dataclass(frozen=True, eq=False)
class _Examples:
    """What is learnt from, of each trajectory of T steps.

    Attributes:
        inputs: What is seen (T, 13).
        goals: The next commanded poses as seen from the food (T, 5 ACTION_CHUNK).
        sentences: Its sentences.
        demos: Kinds of demonstration, of all.
        foods: Foods that are asked for, of all.
    """

    inputs: list[np.ndarray]
    goals: list[np.ndarray]
    sentences: list[list[str]]
    demos: set[str]
    foods: set[str]


def _fit(
    examples: _Examples, vocabulary: Sequence[str], seed: int
) -> tuple[list[tuple[np.ndarray, np.ndarray]], float]:
    """Weights of the layers, and the mean error of the last step."""
    import torch

    bags = [np.array([bag_of_words(s, vocabulary) for s in group]) for group in examples.sentences]
    inputs, goals = np.concatenate(examples.inputs), np.concatenate(examples.goals)
    trajectory = np.repeat(np.arange(len(bags)), [len(steps) for steps in examples.inputs])
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    sizes = [inputs.shape[1] + len(vocabulary), *[HIDDEN_WIDTH] * (LAYER_COUNT - 1), goals.shape[1]]
    layers = [torch.nn.Linear(a, b) for a, b in zip(sizes[:-1], sizes[1:], strict=True)]
    net = torch.nn.Sequential(*[m for layer in layers for m in (layer, torch.nn.ReLU())][:-1])
    adam = torch.optim.Adam(net.parameters(), LEARNING_RATE)
    falling = torch.optim.lr_scheduler.CosineAnnealingLR(adam, TRAINING_STEPS)
    loss = torch.zeros(())
    for _ in range(TRAINING_STEPS):
        some = random.integers(len(inputs), size=BATCH_SIZE)
        words = np.array([bags[k][random.integers(len(bags[k]))] for k in trajectory[some]])
        given = torch.tensor(np.concatenate([inputs[some], words], axis=1), dtype=torch.float32)
        loss = torch.nn.functional.l1_loss(net(given), torch.tensor(goals[some], dtype=torch.float32))
        adam.zero_grad()
        loss.backward()
        adam.step()
        falling.step()
    weights = [
        (layer.weight.detach().double().numpy().copy(), layer.bias.detach().double().numpy().copy()) for layer in layers
    ]
    return weights, float(loss.detach())


def _examples(folder: Path, keep: str, tasks: TaskFilter, most: int | None) -> _Examples:
    """Those of the trajectories that are kept."""
    out = _Examples([], [], [], set(), set())
    for stored in _kept(folder, keep, tasks):
        if most is not None and len(out.inputs) == most:
            break
        item = stored_item(stored.entry["items"][0])
        edge, command = (np.asarray(stored.group[name], float) for name in ("obs/extra/edge", "control/command"))
        n = len(command)
        ahead = np.minimum(np.arange(n)[:, None] + np.arange(ACTION_CHUNK), n - 1)
        out.inputs.append(observed_features(edge[:-1], edge[np.maximum(np.arange(n) - 1, 0)], item))
        out.goals.append(to_food_frame(command, item)[ahead].reshape(n, -1))
        out.sentences.append(list(stored.entry["instructions"]))
        out.demos.add(stored.entry["demos"])
        out.foods.add(item.name)
    if not out.inputs:
        kind = ", ".join(filter(None, (keep, tasks.words())))
        raise TaskError(f"clone: no trajectory of {folder} is kept ({kind}); make more, or keep others")
    return out


def _kept(folder: Path, keep: str, tasks: TaskFilter) -> Iterator[StoredTrajectory]:
    """Those of the trajectories whose simulation did not break down."""
    done = (s for s in trajectories(folder) if s.entry["status"] == "done")
    return (s for s in done if is_kept(s.entry, keep) and tasks.keeps(s.entry))
