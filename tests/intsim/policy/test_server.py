"""A policy server and its client among strangers: every question has an answer with a code and words, every answer is
an action or one line."""

from __future__ import annotations

import base64
import http.client
import io
import json
import socket
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest

from intsim.policy import remote, server
from intsim.policy.remote import TOKEN, Remote, encode_png
from intsim.policy.server import Server
from mpm.scene.errors import CutcalError

Image = pytest.importorskip("PIL.Image", reason="the extra [data] is not installed")
PICTURE = np.zeros((8, 8, 3), np.uint8)
QUESTION = {"instruction": "cut", "pose": [0.0] * 5, "joints": None, "images": {"front": encode_png(PICTURE)}}
OBS = {"pose": np.zeros(5), "joints": None, "items": (), "images": {"front": PICTURE}}


class Policy:
    """One action, given from outside; counts who asks it at the same time."""

    name, action, cameras = "policy", "pose", ("front",)

    def __init__(self, answer=None, takes: float = 0.0) -> None:
        self.answer, self.takes, self.inside, self.most = answer, takes, 0, 0

    def reset(self, seed, instruction):
        """Nothing is kept."""

    def act(self, instruction, pose, joints, images):
        """The answer, or its error."""
        self.inside += 1
        self.most = max(self.most, self.inside)
        time.sleep(self.takes)
        self.inside -= 1
        if isinstance(self.answer, BaseException):
            raise self.answer
        return np.zeros((1, 7)) if self.answer is None else self.answer


@contextmanager
def serving(model=None, **how):
    """A server in a thread."""
    made = Server(model or Policy(), port=0, **how)
    thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield made
    finally:
        made.shutdown()
        made.server_close()


def asked(made, path="/act", content=None, **head):
    """Code and document of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", made.server_port, timeout=10)
    body = json.dumps(QUESTION).encode() if content is None else content
    connection.request("POST", path, body, headers=head)
    answer = connection.getresponse()
    return answer.status, json.loads(answer.read())


def picture_of(kind, size=(8, 8)):
    """A picture in base64."""
    stream = io.BytesIO()
    Image.new("RGB", size).save(stream, kind)
    return base64.b64encode(stream.getvalue()).decode()


def with_picture(text):
    """A question with this picture."""
    return json.dumps(QUESTION | {"images": {"front": text}}).encode()


def test_it_is_this_machines_own(monkeypatch):
    """Without being told otherwise nobody else reaches a server; on another address it wants a token."""
    monkeypatch.delenv(TOKEN, raising=False)
    with serving() as made:
        assert made.server_address[0] == "127.0.0.1" and asked(made)[0] == 200
    for host in ("0.0.0.0", "", "::", "192.0.2.1", "example.org"):
        with pytest.raises(CutcalError, match=f"other machines reach it; set the variable {TOKEN}"):
            Server(Policy(), host, 0)


def test_a_token_is_asked_for(monkeypatch):
    """A wrong one and none are refused with 401; the client takes it from the environment or is given it."""
    with serving(token="secret") as made:
        address = f"http://127.0.0.1:{made.server_port}"
        for head in ({}, {"Authorization": "Bearer secre"}, {"Authorization": "secret"}, {"Authorization": "B\xff"}):
            code, document = asked(made, **head)
            assert code == 401 and TOKEN in document["error"]
        assert asked(made, Authorization="Bearer secret")[0] == 200
        assert Remote(address, token="secret").name == "policy"
        with pytest.raises(CutcalError, match="/about: 401"):
            Remote(address, token="other")
        monkeypatch.setenv(TOKEN, "secret")
        assert Remote(address).name == "policy"
    with serving() as made:  # from the environment, too
        assert made.token == "secret"


@pytest.mark.parametrize("kind", ["BMP", "GIF", "JPEG", "TIFF", "ICNS"])
def test_pictures_are_png(kind):
    """Decoders of other formats are out of reach."""
    with serving() as made:
        code, document = asked(made, content=with_picture(picture_of(kind, (16, 16))))
        assert code == 400 and "no PNG" in document["error"]


def test_pixels_and_bytes_are_limited(monkeypatch):
    """A small file of many pixels, many pictures, and a long question are refused before they take memory."""
    monkeypatch.setattr(remote, "MOST_PIXELS", 100)
    with serving() as made:
        assert asked(made, content=with_picture(picture_of("PNG", (10, 10))))[0] == 200
        code, document = asked(made, content=with_picture(picture_of("PNG", (101, 1))))
        assert code == 400 and "101 x 1 pixels; at most 100" in document["error"]
        many = {f"camera{k}": QUESTION["images"]["front"] for k in range(17)}
        code, document = asked(made, content=json.dumps(QUESTION | {"images": many}).encode())
        assert code == 400 and "17 pictures; at most 16" in document["error"]
        body = json.dumps(QUESTION).encode()
        monkeypatch.setattr(server, "MAX_REQUEST_BYTES", len(body))
        assert asked(made)[0] == 200
        code, document = asked(made, content=body + b" ")
        assert code == 413 and f"at most {len(body)}" in document["error"]
        assert asked(made, content=body + b" " * 3_000_000)[0] == 413, "the answer arrives though much is not read"


def test_a_question_has_100_megabytes_at_most():
    """One that says that it is longer is refused before a byte of it is read."""
    with serving() as made:
        for size, code in ((100_000_001, b" 413 "), (10**30, b" 411 ")):
            with socket.create_connection(("127.0.0.1", made.server_port), timeout=10) as asking:
                asking.sendall(b"POST /act HTTP/1.0\r\nContent-Length: %d\r\n\r\n" % size)
                assert code in asking.makefile("rb").readline()


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"[]", "JSON object"),
        (b"null", "JSON object"),
        (b"[" * 100_000, "RecursionError"),
        (b"\xff", "UnicodeDecodeError"),
        (json.dumps(QUESTION | {"images": []}).encode(), "AttributeError"),
        (json.dumps(QUESTION | {"images": {"front": 5}}).encode(), "no PNG"),
        (json.dumps(QUESTION | {"images": {"front": "%%%"}}).encode(), "no PNG"),
        (json.dumps(QUESTION | {"pose": [float("nan")] * 5}).encode(), "five finite numbers"),
        (json.dumps(QUESTION | {"pose": [10**400] * 5}).encode(), "five finite numbers"),
        (json.dumps(QUESTION | {"joints": [1.0]}).encode(), "nine finite numbers"),
    ],
)
def test_a_strange_question_is_400_with_words(content, word):
    """Whatever is asked there is an answer, and the server goes on."""
    with serving() as made:
        code, document = asked(made, content=content)
        assert code == 400 and word in document["error"]
        assert asked(made, "/reset", b'{"seed": 1, "instruction": ""}') == (200, {"reset": True})
        assert asked(made, "/reset", b'{"seed": 1e999, "instruction": ""}')[0] == 400


@pytest.mark.parametrize(
    ("answer", "word"),
    [
        (ZeroDivisionError("a bug"), "fails with ZeroDivisionError: a bug"),
        (AssertionError(), "fails with AssertionError"),
        (np.full((1, 7), np.nan), "rows of 7 finite numbers"),
        (np.full((2, 7), np.inf), "rows of 7 finite numbers"),
        (np.zeros((1, 8)), "rows of 7 finite numbers"),
        (np.array([["0"] * 7]), "rows of 7 finite numbers"),
    ],
)
def test_a_model_that_fails_is_500_with_words(answer, word):
    """An error of the model and actions that are no finite numbers: the asker is told, and the server goes on."""
    model = Policy(answer)
    with serving(model) as made:
        code, document = asked(made)
        assert code == 500 and word in document["error"]
        policy = Remote(f"http://127.0.0.1:{made.server_port}")
        with pytest.raises(CutcalError, match="/act: 500 "):
            policy.act(OBS, "cut")
        model.answer = None
        assert asked(made)[0] == 200


def test_one_question_at_a_time():
    """Several that ask together are answered, one after the other."""
    model = Policy(takes=0.03)
    with serving(model) as made:
        codes = []
        threads = [threading.Thread(target=lambda: codes.append(asked(made)[0])) for _ in range(5)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert codes == [200] * 5 and model.most == 1


def test_a_question_that_does_not_come(monkeypatch):
    """A connection that says nothing, or too little too slowly, is told so; others are answered meanwhile."""
    monkeypatch.setattr(server._Handler, "timeout", 0.2)
    with serving() as made:
        with socket.create_connection(("127.0.0.1", made.server_port), timeout=10) as slow:
            slow.sendall(b"POST /act HTTP/1.0\r\nContent-Length: 100\r\n\r\n{")
            assert asked(made)[0] == 200
            assert b" 408 " in slow.makefile("rb").readline()
        monkeypatch.setattr(server, "QUESTION_S", 0.0)
        with socket.create_connection(("127.0.0.1", made.server_port), timeout=10) as slow:
            slow.sendall(b"POST /act HTTP/1.0\r\nContent-Length: 100\r\n\r\n{")
            assert b" 408 " in slow.makefile("rb").readline()
        with socket.create_connection(("127.0.0.1", made.server_port), timeout=10) as mute:
            assert mute.recv(1) == b""
        code, _ = asked(made, content=iter([b"{", b"}"]), **{"Transfer-Encoding": "chunked"})
        assert code == 411


@contextmanager
def answering(content, after=b"", pause=0.0):
    """Something that answers every connection with these bytes; its address."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def answer():
            while True:
                try:
                    connection, _ = listening.accept()
                except OSError:
                    return
                with connection:
                    try:
                        connection.recv(65536)
                        connection.sendall(content)
                        for _ in range(1000 if after else 0):
                            time.sleep(pause)
                            connection.sendall(after)
                    except OSError:
                        continue

        threading.Thread(target=answer, daemon=True).start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        listening.shutdown(socket.SHUT_RDWR)


def http_of(body, head="Content-Type: application/json"):
    """An answer of HTTP."""
    return f"HTTP/1.0 200 OK\r\n{head}\r\n\r\n".encode() + body


ABOUT = {"protocol": 1, "name": "x", "action": "pose", "cameras": []}


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"SSH-2.0-OpenSSH_9.6\r\n",
        b"HTTP/1.0 200 OK\r\n" + b"A: b\r\n" * 300 + b"\r\n{}",
        b"HTTP/1.0 999999 \r\n\r\n",
        b"HTTP/1.0 302 Found\r\nLocation: file:///etc/passwd\r\n\r\n",
        b"HTTP/1.0 500 Error\r\n\r\n\x1b[2J words\nof several lines",
        http_of(b""),
        http_of(b"\xff\xfe"),
        http_of(b"{"),
        http_of(b"[" * 100_000),
        http_of(b"9" * 5000),
        http_of(b"[]"),
        http_of(b"{}", "Content-Length: 100"),
        http_of(json.dumps(ABOUT | {"cameras": 5}).encode()),
        http_of(json.dumps(ABOUT | {"cameras": [["a"]]}).encode()),
        http_of(json.dumps(ABOUT | {"cameras": ["a\n"]}).encode()),
        http_of(json.dumps(ABOUT | {"action": ["pose"]}).encode()),
        http_of(json.dumps(ABOUT | {"protocol": 2}).encode()),
    ],
)
def test_a_client_ends_in_one_line(content):
    """Whatever answers, it is one line that can be printed."""
    with answering(content) as address, pytest.raises(CutcalError) as error:
        Remote(address, patience=5)
    assert str(error.value).isprintable() and str(error.value).startswith("--server ")


@pytest.mark.parametrize("address", ["file:///etc/passwd", "ftp://127.0.0.1", "127.0.0.1:1", "http://[", "http://a b"])
def test_an_address_is_one_of_http(address):
    """No file is opened for an address."""
    with pytest.raises(CutcalError, match="--server"):
        Remote(address)


def test_an_answer_has_an_end(monkeypatch):
    """One that is endless is left when it is too long, and one that trickles when it takes too long."""
    with answering(http_of(b" "), b" ", 0.01) as address, pytest.raises(CutcalError, match="not whole after 0.1 s"):
        Remote(address, patience=0.1)
    monkeypatch.setattr(remote, "MAX_ANSWER_BYTES", 1000)
    with answering(http_of(b" "), b" " * 999) as address, pytest.raises(CutcalError, match="longer than 1000 bytes"):
        Remote(address, patience=5)


@pytest.mark.parametrize(
    "answer",
    [
        {"actions": [[0.0] * 6]},
        {"actions": [[float("nan")] * 7]},
        {"actions": [[10**400] * 7]},
        {"actions": [["0"] * 7]},
        {"actions": [[True] * 7]},
        {"actions": {"a": 1}},
        {"actions": []},
        {"actions": [[0.0] * 7, [0.0]]},
        {"actions": [[0.0] * 7] * (remote.MOST_ACTIONS + 1)},
        {"actions": [[0.0] * 7], "done": "false"},
        {},
    ],
)
def test_actions_of_an_answer_are_checked(answer, monkeypatch):
    """Actions that are no rows of finite numbers, too many, or an end that is neither true nor false: one line."""
    monkeypatch.setattr(Remote, "_ask", lambda self, what, document: ABOUT if what == "about" else answer)
    with pytest.raises(CutcalError) as error:
        Remote("http://127.0.0.1").act(OBS, "cut")
    assert str(error.value).isprintable()
