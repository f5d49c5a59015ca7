"""Policies that openpi serves: what is sent, what of an answer is carried out, one clear error for each fault.

The server of the tests marked ``vla`` speaks with the packages as published (openpi-client 0.1.2, websockets), which
are not among the extras. Where they, NumPy, Pillow and pytest alone are installed, ``python -m pytest --noconftest
-m vla -o addopts=--import-mode=importlib`` runs them.
"""

from __future__ import annotations

import gc
import json
import pickle
import sys
import threading
import time

import numpy as np
import pytest

from intsim.policy.openpi import LAYOUTS, OpenPi, read_layout
from intsim.policy.remote import TOKEN
from intsim.task.gym_action import from_gym_action, policy_state, to_gym_action
from mpm.scene.errors import CutcalError

POSE = np.array([0.1, 0.2, 0.3, 0.4, 0.05])
OBS = {
    "pose": POSE,
    "joints": np.arange(9) / 10,
    "items": (),
    "images": {name: np.full((224, 224, 3), shade, np.uint8) for name, shade in (("front", 10), ("wrist", 200))},
}
ADDRESS = "ws://127.0.0.1:8000"


def test_a_layout_is_read():
    """openpi's two, pairs alone, and a pair after a layout; what is neither is one line that names what there is."""
    assert read_layout([]) == read_layout(["libero"]) == LAYOUTS["libero"]
    assert read_layout(["a/b=front", "prompt=prompt"]) == {"a/b": "front", "prompt": "prompt"}
    assert read_layout(["droid", "prompt=state"]) == {**LAYOUTS["droid"], "prompt": "state"}
    for word in ("aloha", "image=fron", "=front"):
        with pytest.raises(CutcalError, match=f"--send {word}: neither libero nor droid nor KEY=WHAT.*gripper"):
            read_layout([word])


def test_without_the_packages_there_is_one_line(monkeypatch):
    """It names the missing one and the command that installs them."""
    monkeypatch.setitem(sys.modules, "openpi_client", None)
    with pytest.raises(CutcalError, match="openpi_client.* is not installed.*: pip install --no-deps openpi-client"):
        OpenPi(ADDRESS)


class Told(OpenPi):
    """A policy whose server's answers are given."""

    def __init__(self, answers, **how) -> None:
        self.answers, self.asked = list(answers), []
        super().__init__(ADDRESS, **how)

    def _contact(self):
        return {}

    def _ask(self, question):
        self.asked.append(question)
        return self.answers.pop(0)


WORDS = ("s=state", "j=joints", "g=gripper", "p=prompt")


def test_what_is_sent_is_what_the_exports_have():
    """State, the arm's seven joints, the gripper that is closed, and the sentence, each under its key."""
    policy = Told([{"actions": np.zeros((1, 7))}], send=WORDS)
    policy.act(OBS, "cut the plum")
    (asked,) = policy.asked
    assert asked["s"] == pytest.approx(policy_state(POSE)) and asked["s"].dtype == np.float32
    assert asked["j"] == pytest.approx(np.arange(7) / 10) and asked["g"].tolist() == [1.0]
    assert asked["p"] == "cut the plum" and policy.name == "openpi s=state j=joints g=gripper p=prompt"


@pytest.mark.parametrize(("replan", "asked_in"), [(None, [0, 4]), (3, [0, 3, 6]), (9, [0, 4])])
def test_of_an_answer_as_many_actions_as_asked_for_are_carried_out(replan, asked_in):
    """One in each step, in their order, turned into metres with the direction that the edge has in that step; then it
    is asked again. A new episode begins with a question."""
    rng = np.random.default_rng(0)
    chunks = rng.uniform(-1, 1, (5, 4, 7))
    policy = Told([{"actions": one} for one in chunks], send=("s=state",), replan=replan)
    for step in range(7):
        pose = POSE + [0, 0, 0, 0.1 * step, 0]
        found = policy.act({**OBS, "pose": pose}, "cut")
        question = max(k for k in asked_in if k <= step)
        assert found == pytest.approx(
            from_gym_action(chunks[asked_in.index(question), step - question], pose[3]), abs=1e-12
        )
    assert len(policy.asked) == len(asked_in)
    policy.reset(0)
    policy.act(OBS, "cut")
    assert len(policy.asked) == len(asked_in) + 1


def test_rows_of_eight_are_joint_targets():
    """They are handed on as they are, and need the robot."""
    row = np.arange(8) / 10
    policy = Told([{"actions": row[None]}] * 2, send=("p=prompt",))
    assert np.array_equal(policy.act(OBS, "cut"), row)
    with pytest.raises(CutcalError, match="moves a robot's joints; evaluate it with --world intsim"):
        policy.act({"pose": POSE}, "cut")


@pytest.mark.parametrize(
    "actions",
    [np.zeros((0, 7)), np.zeros((3, 32)), np.full((2, 7), np.nan), np.zeros(7), [[1, 2], [3]], "up", None, {"a": 1}],
    ids=str,
)
def test_other_actions_are_refused(actions):
    """In one line that says what they are to be."""
    with pytest.raises(CutcalError, match=r"actions .*rows of 7 or 8 finite numbers") as error:
        Told([{"actions": actions}], send=("p=prompt",)).act(OBS, "cut")
    assert str(error.value).isprintable()


def test_an_answer_without_actions_says_what_is_in_it():
    """Such as that of a server of something else."""
    with pytest.raises(CutcalError, match="answers with state, server_timing, and no actions"):
        Told([{"state": 1, "server_timing": {}}], send=("p=prompt",)).act(OBS, "cut")


def test_the_options_go_together(capsys):
    """--send and --replan are of an openpi server alone."""
    pytest.importorskip("taichi", reason="cutcal itself is not installed")
    from cutcal.main import main

    for words in (["--send", "droid"], ["--policy", "remote", "--server", "http://127.0.0.1:9", "--replan", "5"]):
        assert main(["evaluate", *words]) == 1 and "--server ws://HOST:PORT" in capsys.readouterr().err


@pytest.fixture
def served():
    """Servers as openpi's own is: metadata, then an answer for each question, a traceback where there is none."""
    packer = pytest.importorskip("openpi_client.msgpack_numpy", reason="openpi-client is not installed")
    sync = pytest.importorskip("websockets.sync.server", reason="websockets is not installed")
    from websockets.exceptions import ConnectionClosed

    servers = []

    def serve(answer, metadata=None, heads=None):
        def handle(connection) -> None:
            if heads is not None:
                heads.append(connection.request.headers.get("Authorization"))
            connection.send(metadata if isinstance(metadata, (str, bytes)) else packer.packb(metadata or {}))
            try:
                for question in connection:
                    found = answer(packer.unpackb(question))
                    connection.send(found if isinstance(found, (str, bytes)) else packer.packb(found))
                    if isinstance(found, str):
                        connection.close(1011)
            except ConnectionClosed:
                pass

        server = sync.serve(handle, "127.0.0.1", 0, compression=None, max_size=None)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        servers.append(server)
        return f"ws://127.0.0.1:{server.socket.getsockname()[1]}"

    yield serve
    for server in servers:
        server.shutdown()


@pytest.mark.vla
def test_a_server_is_sent_what_openpis_client_sends(served):
    """Array by array, bit for bit and type by type, what the published client and its function for pictures send of the
    same step: openpi's Libero example, with pictures that are not square. Their answers are the same, and so are what
    the server says of itself and the word for it."""
    pytest.importorskip("typing_extensions", reason="openpi-client needs it and does not say so")
    from openpi_client.image_tools import convert_to_uint8, resize_with_pad
    from openpi_client.websocket_client_policy import WebsocketClientPolicy

    asked, heads, chunk = [], [], np.random.default_rng(0).uniform(-1, 1, (3, 7)).astype(np.float32)

    def answer(question):
        asked.append(question)
        return {"actions": chunk, "server_timing": {"infer_ms": 1.0}}

    address = served(answer, {"reset_pose": [0.0, 1.0]}, heads)
    rng = np.random.default_rng(1)
    images = {name: rng.integers(0, 256, (96, 128, 3), np.uint8) for name in ("front", "wrist", "side")}
    theirs = WebsocketClientPolicy(address, api_key="a word")
    element = {
        "observation/image": convert_to_uint8(resize_with_pad(images["front"], 224, 224)),
        "observation/wrist_image": convert_to_uint8(resize_with_pad(images["wrist"], 224, 224)),
        "observation/state": policy_state(POSE).astype(np.float32),
        "prompt": "cut the plum",
    }
    wanted = theirs.infer(element)["actions"]
    ours = OpenPi(address, token="a word")
    assert ours.metadata == theirs.get_server_metadata() == {"reset_pose": [0.0, 1.0]}
    assert "reset_pose" in ours.name and heads == ["Api-Key a word"] * 2
    found = [ours.act({**OBS, "images": images}, "cut the plum") for _ in range(3)]
    assert found == pytest.approx(np.array([from_gym_action(row, POSE[3]) for row in wanted.astype(float)]), abs=1e-9)
    assert len(asked) == 2 and asked[0].keys() == asked[1].keys()
    for key, value in asked[0].items():
        assert np.array_equal(asked[1][key], value), key
        assert getattr(asked[1][key], "dtype", str) == getattr(value, "dtype", str), key


@pytest.mark.vla
def test_droids_names_are_sent(served):
    """Those of openpi's DROID example, of the same shapes; eight numbers come back."""
    asked = []

    def answer(question):
        asked.append({key: np.shape(value) for key, value in question.items()})
        return {"actions": np.zeros((2, 8))}

    policy = OpenPi(served(answer), ["droid", "observation/exterior_image_1_left=front"])
    assert policy.act(OBS, "cut").shape == (8,)
    pictures = {f"observation/{name}": (224, 224, 3) for name in ("exterior_image_1_left", "wrist_image_left")}
    others = {"observation/joint_position": (7,), "observation/gripper_position": (1,), "prompt": ()}
    assert asked == [{**pictures, **others}]


@pytest.mark.vla
def test_an_error_of_the_server_is_its_last_line(served, monkeypatch):
    """A traceback in place of actions, and in place of metadata; the next question opens another connection."""
    monkeypatch.delenv(TOKEN, raising=False)
    answers = [
        "Traceback (most recent call last):\n  File ...\nKeyError: 'observation/image'\n",
        {"actions": [[0] * 7]},
    ]
    heads: list = []
    policy = OpenPi(served(lambda question: answers.pop(0), heads=heads), ["p=prompt"])
    with pytest.raises(CutcalError, match="the server says: KeyError: 'observation/image'$"):
        policy.act(OBS, "cut")
    assert policy.act(OBS, "cut") == pytest.approx(np.zeros(7)) and heads == [None, None]
    with pytest.raises(CutcalError, match="the server says: Robot policy not available$"):
        OpenPi(served(None, "Robot policy not available"))


def _array(kind: object, shape: object = (1,), data: object = bytes(8)) -> dict:
    """An answer with an array as msgpack_numpy packs one, or nearly."""
    return {"actions": {b"__ndarray__": True, b"data": data, b"dtype": kind, b"shape": shape}}


DAMAGED = [
    b"",
    b"\xc1",
    b"\x93\x01",
    b"\x01",
    b"\x81\x01\x01",
    b"\x91" * 2000,
    _array(b"zz"),
    _array(b"<f8", (10**12,)),
    _array(b"<f8", (-1,)),
    _array(b"<f8", data=3),
    {"actions": {b"__ndarray__": True}},
]
OF_OBJECTS = [_array(b"|O"), _array(b"O,f8"), {"actions": {b"__npgeneric__": True, b"data": 3, b"dtype": b"|O"}}]


@pytest.mark.vla
@pytest.mark.parametrize("answer", DAMAGED, ids=lambda one: repr(one)[:40])
def test_a_damaged_answer_is_one_line(served, answer):
    """Whatever the bytes are."""
    msgpack = pytest.importorskip("msgpack", reason="openpi-client is not installed")
    sent = answer if isinstance(answer, bytes) else msgpack.packb(answer)
    with pytest.raises(CutcalError, match="--server ws://.*: (no answer of an openpi server|answers)") as error:
        OpenPi(served(lambda question: sent), ["p=prompt"]).act(OBS, "cut")
    assert str(error.value).isprintable()


@pytest.mark.vla
@pytest.mark.parametrize("answer", OF_OBJECTS, ids=lambda one: repr(one)[:40])
def test_an_array_of_objects_is_refused(served, answer):
    """It is not made: its objects would be looked for at the addresses that the server gives."""
    msgpack = pytest.importorskip("msgpack", reason="openpi-client is not installed")
    with pytest.raises(CutcalError, match="no answer of an openpi server .an array of "):
        OpenPi(served(lambda question: msgpack.packb(answer)), ["p=prompt"]).act(OBS, "cut")


@pytest.mark.vla
def test_nobody_there_is_one_line(served):
    """Nothing listens, something else does, the address is none, and an answer that does not come."""
    from http.server import BaseHTTPRequestHandler, HTTPServer

    for address in ("ws://127.0.0.1:9", "ws://127.0.0.1:99999", "ws://"):
        with pytest.raises(CutcalError, match="no answer of an openpi server"):
            OpenPi(address)
    other = HTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler)
    threading.Thread(target=other.serve_forever, daemon=True).start()
    with pytest.raises(CutcalError, match="no answer of an openpi server .*valid HTTP response"):
        OpenPi(f"ws://127.0.0.1:{other.server_port}")
    other.shutdown()
    other.server_close()
    late = OpenPi(served(lambda question: time.sleep(1) or {}), ["p=prompt"], patience=0.2)
    with pytest.raises(CutcalError, match="no answer of an openpi server .*timed out"):
        late.act(OBS, "cut")


@pytest.mark.vla
def test_a_connection_is_a_process_own_and_ends_with_the_policy(served):
    """A policy goes to a worker without its connection and opens another; each is closed when its policy is gone, and
    no ping breaks one while a server computes."""
    heads: list = []
    policy = OpenPi(served(lambda question: {"actions": np.zeros((1, 7))}, heads=heads), ["p=prompt"])
    other = pickle.loads(pickle.dumps(policy))
    assert other._link is None and len(heads) == 1
    other.act(OBS, "cut")
    policy.act(OBS, "cut")
    assert len(heads) == 2 and other._link is not policy._link
    links = [policy._link, other._link]
    assert [link.ping_interval for link in links] == [None, None]
    del policy, other
    gc.collect()
    assert [link.state.name for link in links] == ["CLOSED", "CLOSED"]


@pytest.mark.vla
def test_an_evaluation_asks_an_openpi_server(served, tmp_path, capsys):
    """From the command line, on the table: an oracle behind openpi's protocol is still one, and the result says who it
    was. Its rows are actions of ``pd_ee_delta_pose``."""
    pytest.importorskip("taichi", reason="cutcal itself is not installed")
    from calib.material.food import load_food
    from cutcal.main import main
    from intsim.policy.oracles import Oracle
    from intsim.task.suites import FIRST_TEST_SEED, sample_episode

    item, oracle = sample_episode("seeds", FIRST_TEST_SEED, {"plum": load_food("plum")}).item, Oracle()

    def answer(question):
        x, y, z, _, tilt, yaw, _, _ = map(float, question["observation/state"])
        pose = np.array([x, y, z, yaw, tilt])
        found = oracle.act({"pose": pose, "items": (item,)}, question["prompt"])
        still = np.zeros(7) if found is None else found
        return {"actions": to_gym_action(still, yaw)[None].astype(np.float32)}

    words = ["evaluate", "--policy", "remote", "--server", served(answer), "--suite", "seeds", "--food", "plum"]
    sent = ["--send", "observation/state=state", "--send", "prompt=prompt"]
    assert main([*words, *sent, "--episodes", "1", "--out", str(tmp_path / "e"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["policy"] == "remote openpi observation/state=state prompt=prompt"
    assert document["suites"]["seeds"]["strict"]["successes"] == 1
    assert main([*words, "--episodes", "1", "--out", str(tmp_path / "f")]) == 1
    assert "wants pictures of the camera 'front'; evaluate it with --world intsim" in capsys.readouterr().err
