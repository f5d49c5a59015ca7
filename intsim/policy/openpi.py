"""A policy that openpi serves (pi0, pi0-FAST, pi0.5), asked in openpi's own protocol.

    cutcal evaluate --policy remote --server ws://127.0.0.1:8000 --world intsim --pixels 224

Messages on a websocket are MessagePack with NumPy's arrays, as ``openpi_client.msgpack_numpy`` packs them. The server
speaks first: its metadata, a dictionary. Each question is a dictionary of observations, and its answer one with
``actions``: rows of 7 numbers, actions of ``pd_ee_delta_pose`` as the exports have them, or of 8, joint targets [rad]
and the gripper. Text in place of an answer is the server's error. It is never told of a new episode, and never says
that one is over.

What is sent under which key is a layout (:data:`LAYOUTS`, :func:`read_layout`). Pictures come in the size of openpi's
examples, scaled by its own function. A server may want a word, ``Authorization: Api-Key WORD``, which is taken from the
variable of :data:`intsim.policy.remote.TOKEN`.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np

from calib.io.wording import brief, listed
from intsim.policy.remote import (
    ACTION_SIZES,
    ANSWER_TIMEOUT_S,
    MAX_ANSWER_BYTES,
    MOST_ACTIONS,
    TOKEN,
    finite_rows,
    joints_of,
    picture_of,
)
from intsim.render.view import PICTURE_CAMERAS
from intsim.task.gym_action import from_gym_action, policy_state
from mpm.scene.errors import CutcalError

SCHEMES = ("ws://", "wss://")
INSTALL = "pip install --no-deps openpi-client msgpack 'websockets>=15'"
"""How the packages are installed beside cutcal; openpi-client's own requirements exclude NumPy 2, its code does not."""
LAYOUTS: Mapping[str, Mapping[str, str]] = {
    "libero": {
        "observation/image": "front",
        "observation/wrist_image": "wrist",
        "observation/state": "state",
        "prompt": "prompt",
    },
    "droid": {
        "observation/exterior_image_1_left": "front",
        "observation/wrist_image_left": "wrist",
        "observation/joint_position": "joints",
        "observation/gripper_position": "gripper",
        "prompt": "prompt",
    },
}
"""What openpi's examples send: by key a camera, or one of :data:`VALUES`."""
VALUES = ("state", "joints", "gripper", "prompt")
"""State of the exports, shape (8,); joints of the arm [rad], shape (7,); gripper, shape (1,); the sentence."""
CLOSED = 1.0  # gripper's observation in DROID: 0 open, 1 closed
PIXELS = 224  # width and height of the pictures of openpi's examples
OPENING_S, CLOSING_S = 10.0, 1.0  # time for a connection to open, and to close
REFUSED = "VOc"  # kinds of NumPy's arrays that openpi-client does not pack; unpacking one would read at any address


def is_openpi(address: str) -> bool:
    """Whether an address is that of a websocket."""
    return address.startswith(SCHEMES)


def read_layout(words: Sequence[str]) -> dict[str, str]:
    """What is sent, by key.

    Args:
        words: Names of layouts and ``KEY=WHAT``, the last one of a key counts; libero without any.

    Raises:
        CutcalError: A word is none of these.
    """
    known = (*VALUES, *PICTURE_CAMERAS)
    found: dict[str, str] = {}
    for word in words or ("libero",):
        key, _, what = word.rpartition("=")
        if word in LAYOUTS:
            found.update(LAYOUTS[word])
        elif key and what in known:
            found[key] = what
        else:
            raise CutcalError(
                f"--send {brief(word)}: neither {' nor '.join(LAYOUTS)} nor KEY=WHAT, where WHAT is one of "
                f"{', '.join(known)}"
            )
    return found


class OpenPi:
    """The policy of an openpi server.

    Args:
        address: Such as ``ws://host:8000``.
        send: What it is sent, see :func:`read_layout`.
        replan: Actions of an answer that are carried out before it is asked again; all of them for None.
        patience: Time until an answer [s].
        token: What the server asks for; that of the environment when None.

    Attributes:
        name: What the results call it.
        metadata: What the server says of itself.

    Raises:
        CutcalError: The packages are not installed, or nothing answers there, or something else.
    """

    def __init__(
        self,
        address: str,
        send: Sequence[str] = (),
        replan: int | None = None,
        patience: float = ANSWER_TIMEOUT_S,
        token: str | None = None,
    ) -> None:
        self.address, self.layout, self.replan, self.patience = address, read_layout(send), replan, patience
        self._token = os.environ.get(TOKEN, "") if token is None else token
        self._todo: list[np.ndarray] = []
        self._link: Any = None
        self.metadata = self._contact()
        said = [*send, f"replan {replan}" if replan else "", brief(self.metadata, 80) if self.metadata else ""]
        self.name = " ".join(["openpi", *filter(None, said)])

    def __getstate__(self) -> dict[str, Any]:
        """What goes to another process, which opens a connection of its own."""
        return {**vars(self), "_link": None}

    def reset(self, seed: int) -> None:
        """A new episode begins; what is left of an answer is dropped."""
        del seed
        self._todo = []

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray:
        """The next action."""
        if not self._todo:
            question = {key: self._observed(what, obs, instruction) for key, what in self.layout.items()}
            self._todo = self._actions(self._ask(question))[: self.replan]
        action = self._todo.pop(0)
        if len(action) == ACTION_SIZES["joints"]:
            joints_of(obs, self.address, self.name)
            return action
        return from_gym_action(action, float(obs["pose"][3]))

    def _observed(self, what: str, obs: dict[str, Any], instruction: str) -> Any:
        """An observation, as openpi's examples have it."""
        if what == "prompt":
            return instruction
        if what == "state":
            return policy_state(obs["pose"]).astype(np.float32)
        if what == "gripper":
            return np.array([CLOSED], np.float32)
        if what == "joints":
            return joints_of(obs, self.address, self.name)[:-2].astype(np.float32)
        from openpi_client.image_tools import resize_with_pad

        return resize_with_pad(np.asarray(picture_of(obs, what, self.address, self.name), np.uint8), PIXELS, PIXELS)

    def _actions(self, answer: dict[str, Any]) -> list[np.ndarray]:
        """Checked actions of an answer.

        Raises:
            CutcalError: There are none, or others.
        """
        if "actions" not in answer:
            raise CutcalError(f"--server {self.address}: answers with {listed(list(answer))}, and no actions")
        given = answer["actions"]
        rows = next((r for size in ACTION_SIZES.values() if (r := finite_rows(given, size)) is not None), None)
        if rows is None or not 0 < len(rows) <= MOST_ACTIONS:
            shape = f" of shape {given.shape}" if isinstance(given, np.ndarray) else ""
            raise CutcalError(
                f"--server {self.address}: answers with actions {brief(given)}{shape}; they are 1 to {MOST_ACTIONS} "
                f"rows of {' or '.join(map(str, ACTION_SIZES.values()))} finite numbers"
            )
        return list(rows)

    def _ask(self, question: dict[str, Any]) -> dict[str, Any]:
        """The answer to a question.

        Raises:
            CutcalError: There is none, or it is the server's error.
        """
        from openpi_client import msgpack_numpy

        if self._link is None:
            self._contact()
        return self._told(lambda: self._link.send(msgpack_numpy.packb(question)))

    def _contact(self) -> dict[str, Any]:
        """Open a connection; returns what the server says of itself.

        Raises:
            CutcalError: The packages are not installed, or there is no such server.
        """
        try:
            import openpi_client.image_tools
            import openpi_client.msgpack_numpy  # noqa: F401 - what is missing is said now
            from websockets.sync.client import connect
        except ImportError as e:
            raise CutcalError(
                f"--server {brief(self.address)}: {e.name} is not installed, which asks openpi's servers: {INSTALL}"
            ) from None

        def begin() -> None:
            opened = ExitStack()
            self._link = opened.enter_context(
                connect(
                    self.address,
                    compression=None,
                    max_size=MAX_ANSWER_BYTES,
                    additional_headers={"Authorization": f"Api-Key {self._token}"} if self._token else None,
                    open_timeout=min(OPENING_S, self.patience),
                    ping_interval=None,  # a server that computes does not answer: the first question takes it a minute
                    close_timeout=CLOSING_S,
                )
            )
            weakref.finalize(self, opened.close)

        return self._told(begin)

    def _told(self, act: Any) -> dict[str, Any]:
        """What the server sends after an act, a dictionary; without one the connection is given up.

        Raises:
            CutcalError: It is no dictionary, or nothing comes.
        """
        from websockets.exceptions import WebSocketException

        try:
            act()
            message = self._link.recv(timeout=self.patience)
            if isinstance(message, str):
                why = f"the server says: {_last_line(message)}"
            else:
                found = _unpacked(message)
                if isinstance(found, dict):
                    return found
                why = f"answers {brief(found)}, no dictionary"
        except (OSError, WebSocketException, ValueError, TypeError, LookupError, RecursionError, OverflowError) as e:
            why = f"no answer of an openpi server ({brief(str(e) or type(e).__name__, 200)})"
        if self._link is not None:
            self._link.close()
            self._link = None
        raise CutcalError(f"--server {brief(self.address)}: {why}")


def _unpacked(message: bytes) -> Any:
    """What a message says, as openpi-client unpacks it, without arrays of the kinds :data:`REFUSED`.

    Raises:
        ValueError: It is damaged, or has such an array.
    """
    import msgpack
    from openpi_client.msgpack_numpy import unpack_array

    def checked(one: dict[Any, Any]) -> Any:
        if {b"__ndarray__", b"__npgeneric__"} & one.keys() and np.dtype(one[b"dtype"]).kind in REFUSED:
            raise ValueError(f"an array of {brief(one[b'dtype'])}")
        return unpack_array(one)

    return msgpack.unpackb(message, object_hook=checked)


def _last_line(text: str) -> str:
    """The line of a traceback that says what was wrong."""
    lines = [line for line in map(str.strip, text.splitlines()) if line]
    return brief(lines[-1], 400) if lines else "nothing"
