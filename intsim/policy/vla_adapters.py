"""Published policies as servers of :mod:`intsim.policy.remote`: RDT, Octo, OpenVLA and those of LeRobot.

    python -m intsim.policy.vla_adapters openvla --weights runs/openvla-cutcal --key cutcal --port 8000
    cutcal evaluate --policy remote --server http://127.0.0.1:8000 --world intsim --pixels 256

Each is loaded by its authors' own code and runs in an environment of its own, with the packages that they ask for and a
GPU; the evaluation runs in another. They have to be fine-tuned on an export of ``cutcal dataset`` first: none has seen
a knife. Of this project they import what needs NumPy alone (and Pillow, for pictures): put the checkout on PYTHONPATH.
No weights are loaded in the tests, where stand-ins take the place of the packages; LeRobot itself is tried with a small
random policy where it is installed (tests marked ``vla``).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from intsim.policy.lerobot_adapter import LeRobotPolicy
from intsim.policy.remote import TOKEN, Model
from intsim.policy.server import Server
from intsim.task.gym_action import from_gym_action
from mpm.scene.errors import CutcalError

FRONT_CAMERA = "front"  # the picture that all three are given
ACTION_STRIDE = 4  # RDT's actions are interpolated four times finer than its control
HISTORY = 2  # pictures that RDT and Octo remember
CROP_AREA = 0.9  # part of a picture's area that OpenVLA is shown, as in its training with crops
STATISTICS_FILE = "dataset_statistics.json"  # beside the weights of a fine-tuned OpenVLA
PRIMARY_PIXELS, WRIST_PIXELS = 256, 128  # sizes of Octo's pictures


class OpenVLA:
    """OpenVLA (Kim et al. 2024, arXiv:2406.09246): one picture, one change of pose.

    It is shown the middle of the picture, nine tenths of its area, in the picture's size, as its authors' evaluations
    do of a model that was fine-tuned with crops.

    Args:
        weights: Folder or name of a fine-tuned model.
        key: Name of the data set whose statistics scale its actions back; the only one where it is empty.
        device: Of the network.
        statistics: File of these statistics; ``dataset_statistics.json`` beside the weights without it, if it is there.

    Raises:
        CutcalError: There are no statistics of that name.
    """

    name, action = "openvla", "pose"
    cameras: Sequence[str] = (FRONT_CAMERA,)

    def __init__(self, weights: str, key: str, device: str = "cuda:0", statistics: str | None = None) -> None:
        import torch
        from transformers import AutoModelForVision2Seq, AutoProcessor

        self.device, self.kind = device, torch.bfloat16
        self.processor = AutoProcessor.from_pretrained(weights, trust_remote_code=True)
        self.network = AutoModelForVision2Seq.from_pretrained(
            weights, torch_dtype=self.kind, low_cpu_mem_usage=True, trust_remote_code=True
        ).to(device)
        own = Path(statistics) if statistics is not None else Path(weights) / STATISTICS_FILE
        if statistics is not None or own.is_file():
            self.network.norm_stats = _statistics(own)
        known = list(getattr(self.network, "norm_stats", None) or {})
        self.key = key or (known[0] if len(known) == 1 else "")
        if self.key not in known:
            raise CutcalError(
                f"openvla: --key {key!r}: its statistics are of {', '.join(known) or 'nothing'}; give the name of the "
                f"data set that it was fine-tuned on, and --statistics FILE where they are not beside the weights"
            )

    def reset(self, seed: int, instruction: str) -> None:
        """It remembers nothing."""

    def act(
        self, instruction: str, pose: np.ndarray, joints: np.ndarray | None, images: dict[str, np.ndarray]
    ) -> np.ndarray:
        """Ask for one action.

        Args:
            instruction: What is asked for, in words.
            pose: Pose of the edge x, y, z [m], yaw and tilt [rad], shape (5,).
            joints: Arm and fingers [rad, m], shape (9,); not used.
            images: Pictures by camera, from 0 to 255 [-], shape (h, w, 3) each.

        Returns:
            Change of pose [m, rad] and gripper, shape (1, 7).
        """
        asked = f"In: What action should the robot take to {instruction.lower()}?\nOut:"
        given = self.processor(asked, _cropped(images[FRONT_CAMERA])).to(self.device, dtype=self.kind)
        found = self.network.predict_action(**given, unnorm_key=self.key, do_sample=False)
        return from_gym_action(np.asarray(found, float).reshape(1, 7), pose[3])


class Octo:
    """Octo (Octo Model Team 2024, arXiv:2405.12213): two pictures and those a step before, a few changes of pose.

    Args:
        weights: Folder or name of a fine-tuned model.
        key: Name of the data set whose statistics scale its actions back, where the model has several.
    """

    name, action, history = "octo", "pose", HISTORY
    cameras: Sequence[str] = (FRONT_CAMERA, "wrist")

    def __init__(self, weights: str, key: str = "") -> None:
        from octo.model.octo_model import OctoModel

        self.network = OctoModel.load_pretrained(weights)
        found = self.network.dataset_statistics
        self.statistics = (found[key] if key else found)["action"]
        self.reset(0, "")

    def reset(self, seed: int, instruction: str) -> None:
        """Forget the last picture."""
        import jax

        self.random = jax.random.PRNGKey(seed)
        self.seen: deque[dict[str, np.ndarray]] = deque(maxlen=HISTORY)
        self.task = self.network.create_tasks(texts=[instruction])

    def see(self, images: dict[str, np.ndarray]) -> None:
        """Take in the pictures of a step (h, w, 3), by camera."""
        self.seen.append(
            {
                "image_primary": _sized(images[FRONT_CAMERA], PRIMARY_PIXELS),
                "image_wrist": _sized(images["wrist"], WRIST_PIXELS),
            }
        )

    def act(
        self, instruction: str, pose: np.ndarray, joints: np.ndarray | None, images: dict[str, np.ndarray]
    ) -> np.ndarray:
        """Ask for some actions.

        Args:
            instruction: What is asked for, in words.
            pose: Pose of the edge x, y, z [m], yaw and tilt [rad], shape (5,).
            joints: Arm and fingers [rad, m], shape (9,); not used.
            images: Pictures by camera, from 0 to 255 [-], shape (h, w, 3) each.

        Returns:
            Changes of pose [m, rad] and gripper, shape (n, 7).
        """
        import jax

        self.see(images)
        now = self.seen[-1]
        missing = HISTORY - len(self.seen)
        window = [self.seen[0]] * missing + list(self.seen)
        given: dict[str, np.ndarray] = {name: np.stack([one[name] for one in window])[None] for name in now}
        given["timestep_pad_mask"] = np.array([[False] * missing + [True] * len(self.seen)])
        self.random, own = jax.random.split(self.random)
        found = self.network.sample_actions(given, self.task, unnormalization_statistics=self.statistics, rng=own)
        return from_gym_action(np.asarray(found, float)[0], pose[3])


class RDT:
    """RDT (Liu et al. 2024, arXiv:2410.07864): two pictures and joints, a row of joint targets.

    It is asked by the model of its authors' ManiSkill evaluation.

    Args:
        weights: Checkpoint, .pt or .safetensors.
        root: Its authors' repository, which is no package.
        statistics: statistics.json of the export that it was fine-tuned on.
        text, vision: Names of its encoders.
    """

    name, action, history = "rdt", "joints", HISTORY
    cameras: Sequence[str] = (FRONT_CAMERA,)

    def __init__(
        self,
        weights: str,
        root: str,
        statistics: str,
        text: str = "google/t5-v1_1-xxl",
        vision: str = "google/siglip-so400m-patch14-384",
    ) -> None:
        sys.path.insert(0, str(root))
        import torch
        import yaml
        from scripts import maniskill_model

        config = yaml.safe_load((Path(root) / "configs" / "base.yaml").read_text(encoding="utf-8"))
        maniskill_model.DATA_STAT.update(json.loads(Path(statistics).read_text(encoding="utf-8")))
        self.network = maniskill_model.create_model(
            args=config,
            dtype=torch.bfloat16,
            pretrained=weights,
            pretrained_text_encoder_name_or_path=text,
            pretrained_vision_encoder_name_or_path=vision,
        )
        self.reset(0, "")

    def reset(self, seed: int, instruction: str) -> None:
        """Forget the last picture, and encode the sentence."""
        import torch

        torch.manual_seed(seed)
        self.network.reset()
        self.words = self.network.encode_instruction(instruction)
        self.seen: deque[Any] = deque([None] * HISTORY, maxlen=HISTORY)

    def see(self, images: dict[str, np.ndarray]) -> None:
        """Take in the pictures of a step (h, w, 3), by camera."""
        from PIL import Image

        self.seen.append(Image.fromarray(images[FRONT_CAMERA]))

    def act(
        self, instruction: str, pose: np.ndarray, joints: np.ndarray | None, images: dict[str, np.ndarray]
    ) -> np.ndarray:
        """Ask for a row of joint targets.

        Args:
            instruction: What is asked for, in words.
            pose: Pose of the edge x, y, z [m], yaw and tilt [rad], shape (5,); not used.
            joints: Arm and fingers [rad, m], shape (9,).
            images: Pictures by camera, from 0 to 255 [-], shape (h, w, 3) each.

        Returns:
            Joint targets [rad] and gripper, shape (n, 8).

        Raises:
            ValueError: Joints are missing.
        """
        import torch

        if joints is None:
            raise ValueError("joints are missing: RDT is evaluated with --world intsim")
        self.see(images)
        shown = [one for picture in self.seen for one in (picture, None, None)]  # its wrist cameras are not there
        own = torch.tensor(joints[None, :-1], dtype=torch.float32)
        found = self.network.step(own, shown, self.words).squeeze(0).cpu().numpy()
        return np.asarray(found, float)[::ACTION_STRIDE]


def _cropped(image: np.ndarray) -> Any:
    """The middle of a picture (h, w, 3), :data:`CROP_AREA` of it, in the picture's size."""
    from PIL import Image

    whole = Image.fromarray(image)
    width, height = (int(np.sqrt(CROP_AREA) * size) for size in whole.size)
    left, top = round((whole.width - width) / 2), round((whole.height - height) / 2)
    part = whole.crop((left, top, left + width, top + height))
    return part.resize(whole.size, Image.Resampling.BILINEAR)


def _statistics(path: Path) -> dict[str, Any]:
    """Statistics by data set.

    Raises:
        CutcalError: There is no such file, or it is no JSON object.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        raise CutcalError(f"--statistics {path}: cannot be read ({e}); give the fine-tuning's own file") from None
    if not isinstance(found, dict):
        raise CutcalError(f"--statistics {path}: is no JSON object of data sets")
    return found


def _sized(image: np.ndarray, size: int) -> np.ndarray:
    """A square picture of another size."""
    from PIL import Image

    return np.array(Image.fromarray(image).resize((size, size), Image.Resampling.LANCZOS))


def load_model(args: argparse.Namespace) -> Model:
    """The model that the command line asks for.

    Raises:
        CutcalError: Its packages are missing, or an option is.
    """
    try:
        if args.model == "openvla":
            return OpenVLA(args.weights, args.key, args.device, args.statistics)
        if args.model == "octo":
            return Octo(args.weights, args.key)
        if args.model == "lerobot":
            return LeRobotPolicy(args.weights, args.device)
        if args.root is None or args.statistics is None:
            raise CutcalError("rdt: give --root, its repository, and --statistics, statistics.json of the export")
        return RDT(args.weights, args.root, args.statistics)
    except ImportError as e:
        raise CutcalError(
            f"{args.model}: {e.name} is not installed; begin this in the environment of its authors"
        ) from None


def main(words: Sequence[str] | None = None) -> int:
    """Serve a model until Ctrl-C."""
    p = argparse.ArgumentParser(
        prog="python -m intsim.policy.vla_adapters", description="Serve a published model as a policy."
    )
    p.add_argument("model", choices=("rdt", "octo", "openvla", "lerobot"))
    p.add_argument("--weights", required=True, help="fine-tuned weights: a folder, a file or a name")
    p.add_argument("--key", default="", help="data set whose statistics scale the actions back (openvla, octo)")
    p.add_argument("--root", help="repository of rdt")
    p.add_argument("--statistics", help="of rdt: statistics.json of the export; of openvla: a dataset_statistics.json")
    p.add_argument("--device", default="cuda:0", help="of openvla and lerobot (default cuda:0)")
    p.add_argument(
        "--host", default="127.0.0.1", help=f"(default 127.0.0.1; another one needs a token in the variable {TOKEN})"
    )
    p.add_argument("--port", type=int, default=8000, help="(default 8000)")
    args = p.parse_args(words)
    try:
        server = Server(load_model(args), args.host, args.port)
    except (CutcalError, OSError) as e:
        sys.stderr.write(f"error: {e}\n")
        return 1
    sys.stderr.write(f"{args.model} answers at http://{args.host}:{server.server_port}\n")
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        pass
    finally:
        server.server_close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
