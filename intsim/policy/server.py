"""A server of the protocol of :mod:`intsim.policy.remote`, for a model that its authors' code runs."""

from __future__ import annotations

import hmac
import ipaddress
import json
import os
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np

from calib.io.wording import brief
from intsim.policy.remote import ACTION_SIZES, PROTOCOL, TOKEN, Model, decode_png, finite_rows
from mpm.scene.errors import CutcalError

MAX_REQUEST_BYTES = 100_000_000  # bytes of a question
MOST_PICTURES = 16  # pictures of a question, those of the past included
MOST_CONNECTIONS = 32  # connections at a time; one more waits for the system's own queue
QUESTION_S = 60.0  # time in which a question must have arrived
SILENCE_S = 20.0  # time in which a connection may say nothing
DRAIN_S = 2.0  # time for which the rest of a refused question is taken, so that the answer is not lost with it
WHERE = "ask for /about, /reset or /act"


class Refused(Exception):
    """A question that has no answer.

    Args:
        code: Of HTTP.
        why: In words.
    """

    def __init__(self, code: int, why: str) -> None:
        super().__init__(why)
        self.code = code


class Server(ThreadingHTTPServer):
    """Answers for a model, one question at a time; ``serve_forever`` begins, ``shutdown`` ends it.

    Args:
        model: Who is asked.
        host, port: Where; port 0 takes a free one, ``server_port``.
        token: What a question must come with; that of the environment when None, empty for none.

    Raises:
        CutcalError: Other machines could ask, and there is no token.
    """

    daemon_threads = True

    def __init__(self, model: Model, host: str = "127.0.0.1", port: int = 8000, token: str | None = None) -> None:
        self.token = os.environ.get(TOKEN, "") if token is None else token
        if not self.token and not is_loopback(host):
            raise CutcalError(
                f"--host {host}: other machines reach it; set the variable {TOKEN} to a secret word, here and where "
                "the policy is asked, or serve on 127.0.0.1"
            )
        self.model, self.asking = model, threading.Lock()
        self._room = threading.Semaphore(MOST_CONNECTIONS)
        super().__init__((host, port), _Handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Begin a connection when there is room for one."""
        self._room.acquire()
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """A connection, in a thread of its own."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that broke off; nothing is to be done."""
        del request, client_address


def is_loopback(host: str) -> bool:
    """Whether an address is this machine's own, which no other reaches."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = SILENCE_S

    def do_GET(self) -> None:
        """Who this is."""
        self._answer(self._about)

    def do_POST(self) -> None:
        """Reset, or act."""
        self._answer(self._asked)

    def _answer(self, made: Any) -> None:
        """Answer with what is made, or say why not."""
        self._left = _size(self.headers.get("Content-Length"))
        try:
            self._check_token()
            code, document = 200, made()
        except Refused as e:
            code, document = e.code, {"error": str(e)}
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError, OverflowError) as e:
            code, document = 400, {"error": f"{type(e).__name__}: {brief(str(e), 200)}"}
        except TimeoutError:
            code, document = 408, {"error": f"the question did not arrive within {QUESTION_S:g} s"}
        self._say(code, document)

    def _check_token(self) -> None:
        given = self.headers.get("Authorization", "").encode("latin-1", "replace")
        if self.server.token and not hmac.compare_digest(given, f"Bearer {self.server.token}".encode()):
            raise Refused(401, f"this server asks for a token: set the variable {TOKEN}")

    def _about(self) -> dict[str, Any]:
        model = self.server.model
        if self.path != "/about":
            raise Refused(404, f"{brief(self.path)}: {WHERE}")
        return {
            "protocol": PROTOCOL,
            "name": str(model.name),
            "action": str(model.action),
            "cameras": [str(c) for c in model.cameras],
            "history": int(getattr(model, "history", 1)),
        }

    def _asked(self) -> dict[str, Any]:
        """Read a question and answer it."""
        if self.path not in ("/reset", "/act"):
            raise Refused(404, f"{brief(self.path)}: {WHERE}")
        if self.headers.get("Transfer-Encoding") or self._left < 0:
            raise Refused(411, "a question has a Content-Length")
        if self._left > MAX_REQUEST_BYTES:
            raise Refused(413, f"a question of {self._left} bytes; at most {MAX_REQUEST_BYTES}")
        asked = json.loads(self._read())
        if not isinstance(asked, dict):
            raise Refused(400, f"a question is a JSON object, not {brief(asked)}")
        return self._reset(asked) if self.path == "/reset" else self._act(asked)

    def _read(self) -> bytes:
        """The question.

        Raises:
            TimeoutError: It does not arrive in time.
        """
        end, parts = time.monotonic() + QUESTION_S, []
        while self._left > 0:
            part = self.rfile.read1(min(self._left, 1 << 20))
            if not part:
                raise Refused(400, "the question ends before its Content-Length")
            parts.append(part)
            self._left -= len(part)
            if time.monotonic() > end:
                raise TimeoutError
        return b"".join(parts)

    def _reset(self, asked: dict[str, Any]) -> dict[str, Any]:
        seed, instruction = int(asked["seed"]), str(asked["instruction"])
        self._model(lambda model: model.reset(seed, instruction))
        return {"reset": True}

    def _act(self, asked: dict[str, Any]) -> dict[str, Any]:
        pose = finite_rows([asked["pose"]], 5)
        if pose is None:
            raise Refused(400, f"pose {brief(asked['pose'])}; five finite numbers")
        joints = None if asked.get("joints") is None else finite_rows([asked["joints"]], 9)
        if joints is None and asked.get("joints") is not None:
            raise Refused(400, f"joints {brief(asked['joints'])}; nine finite numbers")
        shown = [*asked.get("past", ()), asked["images"]]
        if sum(map(len, shown)) > MOST_PICTURES:
            raise Refused(400, f"{sum(map(len, shown))} pictures; at most {MOST_PICTURES}")
        *past, images = [{name: decode_png(text) for name, text in one.items()} for one in shown]
        words = str(asked["instruction"])
        own = None if joints is None else joints[0]

        def act(model: Any) -> np.ndarray:
            for one in past if hasattr(model, "see") else ():
                model.see(one)
            return np.atleast_2d(model.act(words, pose[0], own, images))

        found = self._model(act)
        if not found.size:
            return {"actions": [], "done": True}
        kind = self.server.model.action
        actions = finite_rows(found, ACTION_SIZES.get(kind, 0))
        if actions is None:
            wanted = f"{kind} actions are rows of {ACTION_SIZES.get(kind, 0)} finite numbers"
            raise Refused(500, f"the model acts {brief(found.tolist())}; {wanted}")
        return {"actions": actions.tolist(), "done": False}

    def _model(self, ask: Any) -> Any:
        """What the model answers; nobody else asks it meanwhile.

        Raises:
            Refused: It fails. Whatever its authors' code raises: the server goes on, and the asker is told.
        """
        with self.server.asking:
            try:
                return ask(self.server.model)
            except Exception as e:
                raise Refused(500, f"the model fails with {type(e).__name__}: {brief(str(e), 200)}") from e

    def _say(self, code: int, document: dict[str, Any]) -> None:
        content = json.dumps(document, allow_nan=False).encode()
        self.send_response(code)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(content)
        self.wfile.flush()
        self._drain()

    def _drain(self) -> None:
        """Take what is left of a question: closing a connection with unread bytes in it may tear the answer away."""
        if self._left == 0:
            return
        end = time.monotonic() + DRAIN_S
        self.connection.shutdown(socket.SHUT_WR)
        self.connection.settimeout(DRAIN_S)
        while time.monotonic() < end and self.rfile.read1(1 << 20):
            continue

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the name is http.server's
        """Silence."""
        del format, args


def _size(text: str | None) -> int:
    """Bytes that a question has; -1 where it does not say so."""
    return int(text) if text is not None and text.isascii() and text.isdigit() and len(text) < 19 else -1
