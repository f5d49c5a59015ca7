"""A policy in another process or on another machine, and the small protocol by which it is asked.

HTTP, a JSON document each way:

    GET  /about   -> {"protocol": 1, "name": ..., "action": "pose" or "joints", "cameras": [...]}
    POST /reset   {"seed": 7, "instruction": "cut the plum in half ..."} -> {}
    POST /act     {"instruction": ..., "pose": [x, y, z, yaw, pitch], "joints": [9 numbers] or null,
                   "images": {camera: PNG in base64}} -> {"actions": [[...], ...], "done": false}

``pose`` actions have 7 numbers: change of x, y, z [m], roll, pitch, yaw [rad] from where the edge is, and the gripper; ``joints`` have 8: joint targets
[rad] and the gripper. All actions of an answer are carried out, one in each step of control, before the next question. Foods are not sent:
what a policy may know of them is in the pictures.
"""

from __future__ import annotations

import base64
import io
import json
import math
import urllib.error
import urllib.request
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Protocol

import numpy as np

from mpm.scene.errors import CutcalError

PROTOCOL = 1
NUMBERS = {"pose": 7, "joints": 8}
"""Kinds of action, and how many numbers each has."""
PATIENCE_S = 600.0  # until an answer; the first one may load a network
LARGEST = 100_000_000  # bytes of a question


class Model(Protocol):
    """What a server asks: a policy as its authors' code has it.

    Attributes: name; action, a kind of :data:`NUMBERS`; cameras, the pictures it wants.
    """

    name: str
    action: str
    cameras: Sequence[str]

    def reset(self, seed: int, instruction: str) -> None:
        """A new episode begins."""

    def act(
        self, instruction: str, pose: np.ndarray, joints: np.ndarray | None, images: dict[str, np.ndarray]
    ) -> np.ndarray:
        """The next actions (n, 7 or 8); pictures are (h, w, 3), 8 bits."""


class Remote:
    """The policy of a server.

    Args:
        address: Such as ``http://host:8000``.
        patience: Time until an answer [s].

    Raises:
        CutcalError: Nothing answers there, or something else.
    """

    def __init__(self, address: str, patience: float = PATIENCE_S) -> None:
        self.address, self.patience = address.rstrip("/"), patience
        about = self._ask("about", None)
        kind = about.get("action")
        if about.get("protocol") != PROTOCOL or kind not in NUMBERS:
            raise CutcalError(f"--server {address}: is no policy server of protocol {PROTOCOL} ({str(about)[:80]})")
        self.name, self.action, self.cameras = str(about.get("name")), str(kind), list(about.get("cameras", []))
        self._todo: list[np.ndarray] = []
        self._seed, self._begun, self._done = 0, False, False

    def reset(self, seed: int) -> None:
        """A new episode begins; the server is told with its first sentence."""
        self._seed, self._begun, self._done, self._todo = seed, False, False, []

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
        """The next action, None when the policy has said that it is done."""
        if self.action == "joints" and obs.get("joints") is None:
            raise CutcalError(
                f"--server {self.address}: {self.name} moves a robot's joints; evaluate it with --world intsim"
            )
        if not self._begun:
            self._ask("reset", {"seed": self._seed, "instruction": instruction})
            self._begun = True
        if not self._todo and not self._done:
            joints = obs.get("joints")
            answer = self._ask(
                "act",
                {
                    "instruction": instruction,
                    "pose": np.asarray(obs["pose"], float).tolist(),
                    "joints": None if joints is None else np.asarray(joints, float).tolist(),
                    "images": {name: packed(self._image(obs, name)) for name in self.cameras},
                },
            )
            self._done = bool(answer.get("done"))
            self._todo = [] if self._done and answer.get("actions") == [] else self._actions(answer.get("actions"))
        return self._todo.pop(0) if self._todo else None

    def _image(self, obs: dict[str, Any], name: str) -> np.ndarray:
        try:
            image: np.ndarray = obs["images"][name]
        except KeyError:
            raise CutcalError(
                f"--server {self.address}: {self.name} wants pictures of the camera {name!r}; evaluate it with --world intsim and "
                "--pixels N, which needs Vulkan"
            ) from None
        return image

    def _actions(self, given: Any) -> list[np.ndarray]:
        """Checked actions of an answer."""
        try:
            actions = np.array(given, float)
        except (TypeError, ValueError):
            actions = np.empty(0)
        if actions.ndim != 2 or actions.shape[1] != NUMBERS[self.action] or not np.isfinite(actions).all():
            raise CutcalError(
                f"--server {self.address}: {self.name} answers with actions {str(given)[:80]}; {self.action} actions are rows of "
                f"{NUMBERS[self.action]} finite numbers"
            )
        return list(actions)

    def _ask(self, what: str, document: dict[str, Any] | None) -> dict[str, Any]:
        data = None if document is None else json.dumps(document).encode()
        request = urllib.request.Request(
            f"{self.address}/{what}", data=data, headers={"Content-Type": "application/json"}
        )
        try:
            with urllib.request.urlopen(request, timeout=self.patience) as answer:
                found = json.loads(answer.read())
        except urllib.error.HTTPError as e:
            said = e.read(400).decode("utf-8", "replace").strip()
            raise CutcalError(f"--server {self.address}/{what}: {e.code} {said}") from None
        except (OSError, ValueError) as e:
            raise CutcalError(f"--server {self.address}/{what}: no answer of a policy server ({e})") from None
        if not isinstance(found, dict):
            raise CutcalError(f"--server {self.address}/{what}: answers {str(found)[:80]}, not a JSON object")
        return found


def packed(image: np.ndarray) -> str:
    """A picture (h, w, 3) as PNG in base64."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.asarray(image, np.uint8)).save(stream, "PNG")
    return base64.b64encode(stream.getvalue()).decode()


def unpacked(text: str) -> np.ndarray:
    """A picture (h, w, 3) from :func:`packed`."""
    from PIL import Image

    return np.array(Image.open(io.BytesIO(base64.b64decode(text))).convert("RGB"))


class Server(ThreadingHTTPServer):
    """Answers for a model, one question at a time; ``serve_forever`` begins, ``shutdown`` ends it.

    Args:
        model: Who is asked.
        host, port: Where; port 0 takes a free one, ``server_port``.
    """

    daemon_threads = True

    def __init__(self, model: Model, host: str = "127.0.0.1", port: int = 8000) -> None:
        super().__init__((host, port), _Handler)
        self.model = model


class _Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        """Who this is."""
        model = self.server.model
        if self.path != "/about":
            self._say(404, {"error": f"{self.path}: ask for /about, /reset or /act"})
            return
        about = {
            "protocol": PROTOCOL,
            "name": model.name,
            "action": model.action,
            "cameras": list(model.cameras),
        }
        self._say(200, about)

    def do_POST(self) -> None:
        """Reset, or act."""
        try:
            size = int(self.headers.get("Content-Length", 0))
            if not 0 < size <= LARGEST:
                raise ValueError(f"a question of {size} bytes")
            asked = json.loads(self.rfile.read(size))
            answer = self._answer(asked)
        except (KeyError, TypeError, ValueError, OSError) as e:
            self._say(400, {"error": f"{type(e).__name__}: {e}"})
            return
        self._say(200 if answer is not None else 404, answer or {"error": f"{self.path}: ask for /reset or /act"})

    def _answer(self, asked: dict[str, Any]) -> dict[str, Any] | None:
        model = self.server.model
        if self.path == "/reset":
            model.reset(int(asked["seed"]), str(asked["instruction"]))
            return {"reset": True}
        if self.path == "/act":
            pose = np.array(asked["pose"], float)
            if pose.shape != (5,) or not all(math.isfinite(v) for v in pose):
                raise ValueError(f"pose {asked['pose']}; five finite numbers")
            joints = None if asked.get("joints") is None else np.array(asked["joints"], float)
            images = {name: unpacked(text) for name, text in asked["images"].items()}
            actions = np.atleast_2d(model.act(str(asked["instruction"]), pose, joints, images))
            return {"actions": actions.tolist() if actions.size else [], "done": actions.size == 0}
        return None

    def _say(self, code: int, document: dict[str, Any]) -> None:
        content = json.dumps(document).encode()
        self.send_response(code)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the name is http.server's
        """Silence."""
        del format, args
