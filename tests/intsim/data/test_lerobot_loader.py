"""LeRobot's own loader on an export, and a step of its training: in LeRobot's environment, whose Python the variable
``CUTCAL_LEROBOT`` names (tried with 0.6.1)."""

from __future__ import annotations

import json
import os
import subprocess

import numpy as np
import pytest

from intsim.data import generate as g
from intsim.data.cameras import CAMERA_NAMES
from intsim.data.dataset_document import DatasetSpec
from intsim.data.lerobot import episode_columns, export_lerobot
from intsim.data.manifest import Manifest
from intsim.data.shards import trajectories
from tests.intsim.data.test_generate import Inline
from tests.intsim.painter import PIXELS, Here, Painter, paint_with

pytest.importorskip("pyarrow.parquet", reason="the extra [data] is not installed")
pytest.importorskip("av", reason="the extra [data] is not installed")

READER = """
import json, sys
import torch
from lerobot.datasets import LeRobotDataset, resolve_delta_timestamps
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.factory import make_policy, make_pre_post_processors

small = dict(dim_model=32, n_heads=2, dim_feedforward=32, n_encoder_layers=1, n_vae_encoder_layers=1, latent_dim=4)
config = ACTConfig(device="cpu", pretrained_backbone_weights=None, chunk_size=4, n_action_steps=4, push_to_hub=False, **small)
how = dict(root=sys.argv[1], video_backend="pyav")
whole = LeRobotDataset("cuts", **how)
data = LeRobotDataset("cuts", delta_timestamps=resolve_delta_timestamps(config, whole.meta), **how)
rows = []
for k in range(0, len(whole), max(len(whole) // 12, 1)):
    one = whole[k]
    rows.append({name: value.flatten().tolist() for name, value in one.items()
                 if name in ("observation.state", "action", "contact.force", "episode_index", "frame_index")})
    rows[-1]["task"] = one["task"]
    rows[-1]["shown"] = {n.rsplit(".", 1)[1]: [list(v.shape), 255 * v.mean().item()]
                         for n, v in one.items() if n.startswith("observation.images.")}
policy = make_policy(config, ds_meta=whole.meta)
before, _ = make_pre_post_processors(config, dataset_stats=whole.meta.stats)
batch = before(next(iter(torch.utils.data.DataLoader(data, batch_size=4, shuffle=False))))
policy.train()
loss, _ = policy.forward(batch)
loss.backward()
print(json.dumps({"episodes": whole.meta.total_episodes, "frames": len(whole), "rows": rows, "loss": loss.item(),
                  "inputs": sorted(config.input_features), "chunk": list(batch["action"].shape)}))
"""  # noqa: E501


@pytest.mark.vla
def test_lerobots_loader_gives_what_was_stored_and_its_training_takes_it(tmp_path, monkeypatch):
    """Steps all over the export: state, action, force, sentence and pictures of the right step and background. ACT
    finds its inputs in it, pictures and state and no force, and its loss of a batch is a number."""
    python = os.environ.get("CUTCAL_LEROBOT", "")
    if not python:
        pytest.skip("CUTCAL_LEROBOT names no Python with LeRobot")
    monkeypatch.setattr(g, "require_simulator", lambda: None)
    paint_with(Painter, monkeypatch)
    g.generate(DatasetSpec(Manifest(trajectories=2), shard=2), tmp_path / "set", Inline())
    info = export_lerobot(tmp_path / "set", tmp_path / "lr", backgrounds=[0, 2], pixels=PIXELS, pool=Here())
    told = [(one.entry, episode_columns(one)) for one in trajectories(tmp_path / "set")]
    episodes = [(scene, entry, columns) for scene in (0, 2) for entry, columns in told for _ in entry["instructions"]]
    (tmp_path / "read.py").write_text(READER)
    done = subprocess.run(
        [python, str(tmp_path / "read.py"), str(tmp_path / "lr")],
        capture_output=True,
        text=True,
        env={**os.environ, "HF_HUB_OFFLINE": "1", "HF_HOME": str(tmp_path / "hub"), "PYTHONPATH": ""},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["episodes"] == len(episodes) and found["frames"] == info["total_frames"]
    for row in found["rows"]:
        scene, entry, columns = episodes[row["episode_index"][0]]
        step = row["frame_index"][0]
        for name in ("observation.state", "action", "contact.force"):
            assert row[name] == pytest.approx(columns[name][step].tolist(), abs=1e-6), name
        assert row["task"] in entry["instructions"]
        for camera in CAMERA_NAMES:
            shape, shade = row["shown"][camera]
            assert shape == [3, PIXELS, PIXELS] and shade == pytest.approx((10 * step + 40 * scene) % 256, abs=3)
    pictures = [f"observation.images.{camera}" for camera in CAMERA_NAMES]
    assert found["inputs"] == sorted([*pictures, "observation.state"]) and found["chunk"] == [4, 4, 7]
    assert np.isfinite(found["loss"])
