"""Training of a behaviour-cloning network on a dataset; needs the extra ``[robot]`` (torch)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from calib.errors import OutputError
from intsim.data.shards import StoredTrajectory, stored_item, trajectories
from intsim.policy.behaviour_cloning import (
    ACTION_CHUNK,
    Clone,
    bag_of_words,
    observed_features,
    to_food_frame,
    tokens,
)
from intsim.task.targets import TaskError

HIDDEN_WIDTH, LAYER_COUNT = 256, 3
TRAINING_STEPS, BATCH_SIZE, LEARNING_RATE = 4000, 256, 1e-3  # Adam with a rate that falls to nothing (cosine)
KEEP_KINDS = ("published", "severed", "all")


def train(folder: Path, *, keep: str = "severed", most: int | None = None, seed: int = 0) -> Clone:
    """Train a clone on the trajectories of a dataset.

    Args:
        folder: The dataset.
        keep: Which trajectories: those that meet the ``published`` criteria, those in pieces too (``severed``), or ``all``.
        most: Of those, at most so many.
        seed: Of weights and batches.

    Raises:
        OutputError: There is no dataset, or torch is not installed.
        TaskError: None of its trajectories is kept.
    """
    try:
        import torch
    except ImportError:
        raise OutputError("dataset clone: torch is not installed; pip install 'cutcal[robot]'") from None
    x, sentences, y, count = _examples(folder, keep, most)
    vocabulary = tuple(sorted({w for group in sentences for s in group for w in tokens(s)}))
    bags = [np.array([bag_of_words(s, vocabulary) for s in group]) for group in sentences]
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        sizes = [x[0].shape[1] + len(vocabulary), *[HIDDEN_WIDTH] * (LAYER_COUNT - 1), ACTION_CHUNK * 5]
        layers = [torch.nn.Linear(a, b) for a, b in zip(sizes[:-1], sizes[1:], strict=True)]
        net = torch.nn.Sequential(*[m for layer in layers for m in (layer, torch.nn.ReLU())][:-1])
        adam = torch.optim.Adam(net.parameters(), LEARNING_RATE)
        falling = torch.optim.lr_scheduler.CosineAnnealingLR(adam, TRAINING_STEPS)
        place = np.repeat(np.arange(len(x)), [len(a) for a in x])
        inputs, goals = np.concatenate(x), np.concatenate(y)
        loss = torch.zeros(())
        for _ in range(TRAINING_STEPS):
            some = random.integers(len(inputs), size=BATCH_SIZE)
            words = np.array([bags[k][random.integers(len(bags[k]))] for k in place[some]])
            given = torch.tensor(np.concatenate([inputs[some], words], axis=1), dtype=torch.float32)
            loss = torch.nn.functional.l1_loss(net(given), torch.tensor(goals[some], dtype=torch.float32))
            adam.zero_grad()
            loss.backward()
            adam.step()
            falling.step()
        weights = [
            (layer.weight.detach().double().numpy().copy(), layer.bias.detach().double().numpy().copy())
            for layer in layers
        ]
    finally:
        torch.set_num_threads(before)
    about = {
        "dataset": folder.name,
        "keep": keep,
        "trajectories": count,
        "steps": TRAINING_STEPS,
        "seed": seed,
        "loss": float(loss.detach()),
    }
    return Clone(vocabulary, weights, about)


def _examples(
    folder: Path, keep: str, most: int | None
) -> tuple[list[np.ndarray], list[list[str]], list[np.ndarray], int]:
    """Of each trajectory: what is seen (T, 13), its sentences, and the next commanded poses as seen from the food (T, CHUNK 5)."""
    x: list[np.ndarray] = []
    y: list[np.ndarray] = []
    sentences: list[list[str]] = []
    for stored in _kept(folder, keep):
        if most is not None and len(x) == most:
            break
        item = stored_item(stored.entry["items"][0])
        edge, command = (np.asarray(stored.group[name], float) for name in ("obs/extra/edge", "control/command"))
        n = len(command)
        ahead = np.minimum(np.arange(n)[:, None] + np.arange(ACTION_CHUNK), n - 1)
        x.append(observed_features(edge[:-1], edge[np.maximum(np.arange(n) - 1, 0)], item))
        y.append(to_food_frame(command, item)[ahead].reshape(n, -1))
        sentences.append(list(stored.entry["instructions"]))
    if not x:
        raise TaskError(f"clone: no trajectory of {folder} is kept ({keep}); make more, or keep others")
    return x, sentences, y, len(x)


def _kept(folder: Path, keep: str) -> Iterator[StoredTrajectory]:
    if keep not in KEEP_KINDS:
        raise TaskError(f"clone: keep {keep!r} is none of {', '.join(KEEP_KINDS)}")
    for stored in trajectories(folder):
        a = stored.entry
        if a["status"] == "done" and (keep == "all" or (a["published"] and (keep != "severed" or a["severed"]))):
            yield stored
