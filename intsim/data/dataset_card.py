"""The card of an export: what somebody who finds the folder has to know before training on it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from intsim.task.planner import CONTROL_RATE

CARD_FILE = "README.md"
LICENCES = {True: "cc-by-nc-4.0", False: "mit"}
"""Licence of an export with pictures, and of one without. Pictures show ManiSkill's meshes of the arm, which are CC
BY-NC 4.0; the numbers are made by this project's code alone."""
SHOWN = ("observation.state", "action", "contact.force")  # features whose statistics the card has


def dataset_card(
    info: Mapping[str, Any], stats: Mapping[str, Mapping[str, Any]], episodes: Sequence[Mapping[str, Any]]
) -> str:
    """The card of a LeRobot export, Markdown with the head that a hub reads.

    Args:
        info: Content of ``meta/info.json``.
        stats: Content of ``meta/stats.json``.
        episodes: Rows of ``meta/culinary.parquet``, one an episode.

    Returns:
        The text of its ``README.md``.
    """
    pictured = info["video_path"] is not None
    head = [
        "---",
        f"license: {LICENCES[pictured]}",
        "task_categories:\n- robotics",
        "tags:\n- LeRobot\n- cutting\n- simulation",
        "configs:\n- config_name: default\n  data_files: data/*/*.parquet",
        "---",
    ]
    tasks = {(e["food"], e["index"]) for e in episodes}
    foods = Counter(food for food, _ in tasks)
    counts = [
        ("episodes", info["total_episodes"], "one for each trajectory, background and sentence"),
        ("trajectories", len({e["index"] for e in episodes}), "each simulated once"),
        ("backgrounds", len({e["scene"] for e in episodes if e["scene"] >= 0}), "kitchens of the pictures"),
        ("sentences", info["total_tasks"], "in words that mean the same task"),
        ("steps", info["total_frames"], f"at {CONTROL_RATE:g} Hz"),
        ("meet the published criteria", sum(e["published"] for e in episodes), "of the episodes"),
        ("end with the food in pieces", sum(e["severed"] for e in episodes), "of the episodes"),
    ]
    body = [
        "# Cuts of a simulated Panda that feels the food",
        "Made by `cutcal dataset generate` and `export`: the arm is simulated by ManiSkill, the food by a material "
        "point solver. Nothing in it was measured on a robot. Properties of foods are drawn from ranges of the "
        "literature.",
        _table(("what", "how many", "of what"), counts),
        "Trajectories by food: " + ", ".join(f"{name} {n}" for name, n in sorted(foods.items())) + ".",
        "## Split",
        "All episodes are for training (`train`). None is held out: an evaluation draws tasks of its own, from seeds "
        "that no dataset has (`cutcal evaluate --suite seeds`), and foods or cuts are left out of an export by "
        "`--without`, `--ratio` and `--side`. Episodes of one trajectory share their motion: keep them together in a "
        "split of yours.",
        "## Statistics",
        _table(("feature", "component", "least", "mean", "largest", "standard deviation"), _rows(info, stats)),
        "A policy takes `observation.*` and gives `action`, an action of ManiSkill's `pd_ee_delta_pose`: 1 stands for "
        "0.1 m and for -0.1 rad. Force [N], impulse [N s] and joints are `contact.*` and `extra.*`, which no policy is "
        "given unless it is told to.",
        "## Licence",
        "Pictures show meshes of the arm that come with ManiSkill under CC BY-NC 4.0, hence the licence above."
        if pictured
        else "There are no pictures. All numbers were made by code under the MIT licence.",
    ]
    return "\n".join(head) + "\n\n" + "\n\n".join(body) + "\n"


def _rows(info: Mapping[str, Any], stats: Mapping[str, Mapping[str, Any]]) -> list[tuple[Any, ...]]:
    """A row for each component of the features that are shown."""
    out = []
    for name in SHOWN:
        found = [np.ravel(stats[name][kind]) for kind in ("min", "mean", "max", "std")]
        for k, component in enumerate(info["features"][name]["names"]):
            out.append((f"`{name}`", component, *(f"{values[k]:.4g}" for values in found)))
    return out


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in row) + " |" for row in lines)
