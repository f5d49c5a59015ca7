"""A policy in another process or on another machine, and the small protocol by which it is asked.

HTTP, a JSON document each way:

    GET  /about   -> {"protocol": 1, "name": ..., "action": "pose" or "joints", "cameras": [...], "history": 1}
    POST /reset   {"seed": 7, "instruction": "cut the plum in half ..."} -> {}
    POST /act     {"instruction": ..., "pose": [x, y, z, yaw, pitch], "joints": [9 numbers] or null,
                   "images": {camera: PNG in base64}, "past": [{camera: PNG in base64}, ...]}
                   -> {"actions": [[...], ...], "done": false}

``history`` is how many steps a policy looks at, this one included; ``past`` has the pictures of those before, the
oldest first, as far as they are of this episode. A policy that says nothing looks at one, and is sent no past.

``pose`` actions have 7 numbers: change of x, y, z [m], roll, pitch, yaw [rad] from where the edge is, and the gripper.
``joints`` actions have 8: joint targets [rad] and the gripper. The gripper stays closed, whatever is sent: the knife is
fixed to the hand. All actions of an answer are carried out, one in each control step, before the next question. Foods
are not sent: what a policy may know of them is in the pictures.

What a server cannot answer has a code of HTTP and ``{"error": ...}``. A server that other machines reach wants a token,
``Authorization: Bearer TOKEN``, which both sides take from the variable ``CUTCAL_POLICY_TOKEN``. HTTP is not encrypted:
between machines that do not trust their network, forward the port through SSH. :mod:`intsim.policy.server` is a server.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import os
import time
import urllib.error
import urllib.request
from collections import deque
from collections.abc import Sequence
from http.client import HTTPException
from typing import Any, Protocol

import numpy as np

from calib.io.wording import brief
from mpm.scene.errors import CutcalError

PROTOCOL = 1
ACTION_SIZES = {"pose": 7, "joints": 8}
"""Kinds of action, and how many numbers each has."""
ANSWER_TIMEOUT_S = 600.0  # until an answer; the first one may load a network
MAX_ANSWER_BYTES = 10_000_000  # bytes of an answer
MOST_HISTORY = 16  # steps that a policy may look at
MOST_ACTIONS = 10_000  # actions of an answer: minutes of control steps
MOST_PIXELS = 4096 * 4096  # pixels of a picture
TOKEN = "CUTCAL_POLICY_TOKEN"
"""Variable of the environment that holds what a server asks for; words of the command line are kept with results."""


class Model(Protocol):
    """What a server asks: a policy as its authors' code has it.

    Attributes: name; action, a kind of :data:`ACTION_SIZES`; cameras, the pictures it wants. It may have ``history``,
    how many steps it looks at, and then ``see(images)``, which takes those of the steps since it acted last.
    """

    name: str
    action: str
    cameras: Sequence[str]

    def reset(self, seed: int, instruction: str) -> None:
        """A new episode begins."""

    def act(
        self, instruction: str, pose: np.ndarray, joints: np.ndarray | None, images: dict[str, np.ndarray]
    ) -> np.ndarray:
        """The next actions.

        Args:
            instruction: What is asked for, in words.
            pose: Pose of the edge x, y, z [m], yaw and tilt [rad], shape (5,).
            joints: Arm and fingers [rad, m], shape (9,); None on the plain table.
            images: Pictures by camera, from 0 to 255 [-], shape (h, w, 3) each.

        Returns:
            Actions one after the other [m, rad], shape (n, 7) or (n, 8); none when it is done.
        """


class Remote:
    """The policy of a server.

    Args:
        address: Such as ``http://host:8000``.
        patience: Time until a whole answer [s].
        token: What the server asks for; that of the environment when None.

    Raises:
        CutcalError: Nothing answers there, or something else.
    """

    def __init__(self, address: str, patience: float = ANSWER_TIMEOUT_S, token: str | None = None) -> None:
        self.address, self.patience = address.rstrip("/"), patience
        self._token = os.environ.get(TOKEN, "") if token is None else token
        if not self.address.startswith(("http://", "https://")):
            raise CutcalError(
                f"--server {brief(address)}: is no address such as http://127.0.0.1:8000 or ws://127.0.0.1:8000"
            )
        about = self._ask("about", None)
        kind, cameras = about.get("action"), about.get("cameras", [])
        known = isinstance(kind, str) and kind in ACTION_SIZES
        if about.get("protocol") != PROTOCOL or not known or not _are_names(cameras):
            raise CutcalError(f"--server {address}: is no policy server of protocol {PROTOCOL} ({brief(about)})")
        self.name, self.action, self.cameras = brief(about.get("name")), str(kind), list(cameras)
        history = about.get("history", 1)
        if not (isinstance(history, int) and 1 <= history <= MOST_HISTORY):
            raise CutcalError(f"--server {address}: history {brief(history)}; a whole number from 1 to {MOST_HISTORY}")
        self._past: deque[dict[str, np.ndarray]] = deque(maxlen=history - 1)
        self._todo: list[np.ndarray] = []
        self._seed, self._begun, self._done = 0, False, False

    def reset(self, seed: int) -> None:
        """A new episode begins; the server is told with its first sentence."""
        self._seed, self._begun, self._done, self._todo = seed, False, False, []
        self._past.clear()

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
        """The next action, None when the policy has said that it is done."""
        if self.action == "joints":
            joints_of(obs, self.address, self.name)
        if not self._begun:
            self._ask("reset", {"seed": self._seed, "instruction": instruction})
            self._begun = True
        looks = self._past.maxlen or not self._todo
        now = {name: picture_of(obs, name, self.address, self.name) for name in self.cameras} if looks else {}
        if not self._todo and not self._done:
            joints = obs.get("joints")
            question = {
                "instruction": instruction,
                "pose": np.asarray(obs["pose"], float).tolist(),
                "joints": None if joints is None else np.asarray(joints, float).tolist(),
                "images": _encoded(now),
            }
            if self._past:
                question["past"] = [_encoded(images) for images in self._past]
            answer = self._ask("act", question)
            done = answer.get("done", False)
            if not isinstance(done, bool):
                raise CutcalError(f"--server {self.address}: {self.name} says done: {brief(done)}, not true or false")
            self._done = done
            self._todo = [] if self._done and answer.get("actions") == [] else self._actions(answer.get("actions"))
        self._past.append(now)
        return self._todo.pop(0) if self._todo else None

    def _actions(self, given: Any) -> list[np.ndarray]:
        """Checked actions of an answer."""
        actions = finite_rows(given, ACTION_SIZES[self.action])
        if actions is None or not 0 < len(actions) <= MOST_ACTIONS:
            raise CutcalError(
                f"--server {self.address}: {self.name} answers with actions {brief(given)}; {self.action} actions are "
                f"1 to {MOST_ACTIONS} rows of {ACTION_SIZES[self.action]} finite numbers"
            )
        return list(actions)

    def _ask(self, what: str, document: dict[str, Any] | None) -> dict[str, Any]:
        """The answer to a question.

        Raises:
            CutcalError: There is none, or it is none of a policy server.
        """
        where = f"--server {self.address}/{what}"
        head = {"Content-Type": "application/json"} | (
            {"Authorization": f"Bearer {self._token}"} if self._token else {}
        )
        data = None if document is None else json.dumps(document).encode()
        try:
            request = urllib.request.Request(f"{self.address}/{what}", data=data, headers=head)
            with urllib.request.urlopen(request, timeout=self.patience) as answer:
                found = json.loads(_whole(answer, self.patience))
        except urllib.error.HTTPError as e:
            raise CutcalError(f"{where}: {e.code} {_said(e)}") from None
        except (OSError, ValueError, HTTPException, RecursionError) as e:
            raise CutcalError(
                f"{where}: no answer of a policy server ({brief(str(e) or type(e).__name__, 200)})"
            ) from None
        if not isinstance(found, dict):
            raise CutcalError(f"{where}: answers {brief(found)}, not a JSON object")
        return found


def picture_of(obs: dict[str, Any], camera: str, address: str, who: str) -> np.ndarray:
    """What a camera sees.

    Args:
        obs: The observation.
        camera: Its name.
        address: Of the server, for the error.
        who: Name of the policy, for the error.

    Returns:
        The picture, from 0 to 255 [-], shape (h, w, 3).

    Raises:
        CutcalError: There are no such pictures.
    """
    try:
        image: np.ndarray = obs["images"][camera]
    except KeyError:
        raise CutcalError(
            f"--server {address}: {who} wants pictures of the camera {camera!r}; evaluate it with --world intsim and "
            "--pixels N"
        ) from None
    return image


def joints_of(obs: dict[str, Any], address: str, who: str) -> np.ndarray:
    """Joints of the arm and its fingers.

    Args:
        obs: The observation.
        address: Of the server, for the error.
        who: Name of the policy, for the error.

    Returns:
        The joints [rad, m], shape (9,).

    Raises:
        CutcalError: There is no robot.
    """
    joints = obs.get("joints")
    if joints is None:
        raise CutcalError(f"--server {address}: {who} moves a robot's joints; evaluate it with --world intsim")
    return np.asarray(joints, float)


def _encoded(images: dict[str, np.ndarray]) -> dict[str, str]:
    """Pictures by camera, as PNG in base64."""
    return {name: encode_png(image) for name, image in images.items()}


def _are_names(cameras: Any) -> bool:
    return isinstance(cameras, list) and all(isinstance(name, str) and name.isprintable() for name in cameras)


def _whole(answer: Any, patience: float) -> bytes:
    """All bytes of an answer.

    Raises:
        ValueError: There are too many, or they take too long.
    """
    end, content = time.monotonic() + patience, b""
    while part := answer.read1(65536):
        content += part
        if len(content) > MAX_ANSWER_BYTES:
            raise ValueError(f"it is longer than {MAX_ANSWER_BYTES} bytes")
        if time.monotonic() > end:
            raise ValueError(f"it is not whole after {patience:g} s")
    if answer.length:  # what was promised and has not come
        raise ValueError("it ends too early")
    return content


def _said(error: urllib.error.HTTPError) -> str:
    """The words of an answer that says what is wrong, on one line."""
    try:
        return brief(error.read(400).decode("utf-8", "replace").strip(), 400)
    except (OSError, HTTPException):
        return ""


def finite_rows(given: Any, size: int) -> np.ndarray | None:
    """Rows of finite numbers, shape (n, size); None where something else was given.

    Args:
        given: What was given.
        size: Numbers of a row.
    """
    try:
        rows = np.array(given)
        rows = rows.astype(float) if rows.dtype.kind in "iuf" else np.empty(0)
    except (TypeError, ValueError, OverflowError):
        return None
    return rows if rows.ndim == 2 and rows.shape[1] == size and np.isfinite(rows).all() else None


def encode_png(image: np.ndarray) -> str:
    """A picture (h, w, 3) as PNG in base64."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.asarray(image, np.uint8)).save(stream, "PNG")
    return base64.b64encode(stream.getvalue()).decode()


def decode_png(text: str) -> np.ndarray:
    """A picture (h, w, 3) from :func:`encode_png`.

    Raises:
        ValueError: It is no PNG, damaged, or has more pixels than :data:`MOST_PIXELS`.
    """
    from PIL import Image

    try:
        content = base64.b64decode(text, validate=True)
        with Image.open(io.BytesIO(content), formats=["PNG"]) as image:
            if image.width * image.height > MOST_PIXELS:
                raise ValueError(f"a picture of {image.width} x {image.height} pixels; at most {MOST_PIXELS}")
            return np.array(image.convert("RGB"))
    except (OSError, SyntaxError, TypeError, binascii.Error, Image.DecompressionBombError) as e:
        raise ValueError(f"a picture is no PNG in base64 ({brief(str(e))})") from None
