"""Policies on a server: the protocol both ways, one clear error for each fault, and published models behind stand-ins
of their packages."""

from __future__ import annotations

import json
import sys
import threading
import urllib.request
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from cutcal.main import main
from intsim.policy import vla_adapters
from intsim.policy.oracles import Oracle
from intsim.policy.remote import Remote, decode_png, encode_png
from intsim.policy.server import Server
from intsim.policy.vla_adapters import RDT, Octo, OpenVLA
from intsim.task.gym_action import from_gym_action
from mpm.scene.errors import CutcalError

pytest.importorskip("PIL.Image", reason="the extra [data] is not installed")

POSE = np.array([0.1, 0.2, 0.3, 0.4, 0.0])
JOINTS = np.arange(9) / 10
SEEN = {name: np.full((8, 8, 3), shade, np.uint8) for name, shade in (("front", 10), ("wrist", 200))}
RAMP = np.broadcast_to(np.arange(0, 200, 2, dtype=np.uint8)[:, None], (100, 100, 3)).copy()
"""A picture 100 wide, brighter by 2 a pixel from left to right."""
OBS = {"pose": POSE, "joints": JOINTS, "items": (), "images": SEEN}


class Counting:
    """Three actions at a time, whose first number counts; done after six."""

    name, action, cameras = "counting", "pose", ("front",)

    def __init__(self) -> None:
        self.asked: list = []
        self.k = 0

    def reset(self, seed: int, instruction: str) -> None:
        """Begin at the seed."""
        self.k, self.asked = seed, [(seed, instruction)]

    def act(self, instruction, pose, joints, images):
        """What it was asked is kept."""
        self.asked.append((instruction, pose, joints, images))
        if len(self.asked) > 3:
            return np.empty((0, 7))
        self.k += 3
        return np.array([[k, *[0.0] * 6] for k in range(self.k - 3, self.k)])


@pytest.fixture
def served():
    """Servers of models, by address."""
    servers = []

    def serve(model) -> str:
        server = Server(model, port=0)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        servers.append(server)
        return f"http://127.0.0.1:{server.server_port}"

    yield serve
    for server in servers:
        server.shutdown()
        server.server_close()


def test_actions_come_in_their_order_and_end(served):
    """A question for every three steps, with pose, joints and the picture bit for bit; the model's own end is the
    policy's."""
    model = Counting()
    policy = Remote(served(model))
    assert policy.name == "counting"
    policy.reset(7)
    found = []
    while (action := policy.act(OBS, "cut the plum")) is not None:
        found.append(action)
    assert [a[0] for a in found] == [7, 8, 9, 10, 11, 12] and all(a.shape == (7,) for a in found)
    assert model.asked[0] == (7, "cut the plum") and len(model.asked) == 4
    words, pose, joints, images = model.asked[1]
    assert words == "cut the plum" and np.array_equal(pose, POSE) and np.array_equal(joints, JOINTS)
    assert list(images) == ["front"] and np.array_equal(images["front"], SEEN["front"])
    policy.reset(1)
    again = policy.act(OBS, "cut the plum")
    assert again is not None and again[0] == 1


def test_a_picture_comes_back():
    """PNG loses nothing."""
    image = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
    assert np.array_equal(decode_png(encode_png(image)), image)


def test_what_is_wrong_is_said(served):
    """Nobody there, something else there, missing pictures and joints, actions of another kind, an error of the
    model."""
    with pytest.raises(CutcalError, match="no answer of a policy server"):
        Remote("http://127.0.0.1:9")
    with pytest.raises(CutcalError, match="--pixels"):
        Remote(served(Counting())).act({"pose": POSE}, "cut")
    joints = Counting()
    joints.action = "joints"
    policy = Remote(served(joints))
    with pytest.raises(CutcalError, match="--world intsim"):
        policy.act({"pose": POSE, "images": SEEN}, "cut")
    with pytest.raises(CutcalError, match="rows of 8 finite numbers"):
        policy.act(OBS, "cut")
    strange = Counting()
    strange.action = "thoughts"
    with pytest.raises(CutcalError, match="no policy server of protocol"):
        Remote(served(strange))
    failing = Counting()
    failing.act = lambda *asked: (_ for _ in ()).throw(ValueError("out of memory"))  # type: ignore[method-assign]
    policy = Remote(served(failing))
    with pytest.raises(CutcalError, match="500 .*fails with ValueError: out of memory"):
        policy.act(OBS, "cut")


@pytest.mark.parametrize(
    ("path", "content", "code"),
    [
        ("/act", b"{", 400),
        ("/act", b"{}", 400),
        ("/act", b'{"pose": [1, 2], "images": {}, "instruction": ""}', 400),
        ("/elsewhere", b"{}", 404),
        ("/act", b"", 400),
    ],
)
def test_a_server_answers_what_it_does_not_understand(served, path, content, code):
    """With a code and words, and goes on."""
    address = served(Counting())
    with pytest.raises(urllib.request.HTTPError) as error:  # type: ignore[attr-defined]
        urllib.request.urlopen(urllib.request.Request(address + path, data=content), timeout=10)
    assert error.value.code == code and "error" in json.loads(error.value.read())
    assert Remote(address).name == "counting"


class Asked:
    """An oracle behind a server: it knows the foods, which a real policy does not."""

    name, action, cameras = "asked", "pose", ()

    def __init__(self, items) -> None:
        self.items, self.oracle = items, Oracle()

    def reset(self, seed: int, instruction: str) -> None:
        """Forget."""
        self.oracle.reset(seed)

    def act(self, instruction, pose, joints, images):
        """The oracle's word."""
        found = self.oracle.act({"pose": pose, "items": self.items}, instruction)
        return np.empty((0, 7)) if found is None else found


def test_an_evaluation_asks_a_server(served, tmp_path, capsys):
    """From the command line, on the table: an oracle behind the protocol is still one."""
    from calib.material.food import load_food
    from intsim.task.suites import FIRST_TEST_SEED, sample_episode

    episode = sample_episode("seeds", FIRST_TEST_SEED, {"plum": load_food("plum")})
    address = served(Asked((episode.item,)))
    words = ["evaluate", "--policy", "remote", "--server", address, "--suite", "seeds", "--food", "plum"]
    assert main([*words, "--episodes", "1", "--out", str(tmp_path / "e"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["policy"] == "remote asked" and document["suites"]["seeds"]["strict"]["successes"] == 1
    assert main(["evaluate", "--policy", "remote"]) == 1 and "--server" in capsys.readouterr().err
    assert main(["evaluate", "--pixels", "64"]) == 1 and "--world intsim" in capsys.readouterr().err


class Tensor:
    """What is needed of one."""

    def __init__(self, values) -> None:
        self.values = np.asarray(values, float)

    def squeeze(self, axis: int):
        """Without an axis."""
        return Tensor(self.values.squeeze(axis))

    def cpu(self):
        """The same."""
        return self

    def numpy(self) -> np.ndarray:
        """Its numbers."""
        return self.values


@pytest.fixture
def packages(monkeypatch):
    """Stand-ins of the packages of three models, which write down what they are asked."""
    calls: list = []

    def module(name: str, **content) -> None:
        made = ModuleType(name)
        for key, value in content.items():
            setattr(made, key, value)
        monkeypatch.setitem(sys.modules, name, made)

    def called(name, answer=None):
        def call(*args, **how):
            calls.append((name, args, how))
            return answer(*args, **how) if callable(answer) else answer

        return call

    inputs = SimpleNamespace(to=lambda device, dtype: {"pixels": 1})
    network = SimpleNamespace(predict_action=called("predict", np.arange(7.0)), norm_stats={"cutcal": {}, "bridge": {}})
    module("torch", bfloat16="bf16", float32="f32", manual_seed=called("seed"), tensor=lambda v, dtype: Tensor(v))
    module(
        "transformers",
        AutoProcessor=SimpleNamespace(from_pretrained=lambda name, **how: called("processor", inputs)),
        AutoModelForVision2Seq=SimpleNamespace(
            from_pretrained=lambda name, **how: SimpleNamespace(to=lambda device: network)
        ),
    )
    octo = SimpleNamespace(
        dataset_statistics={"cutcal": {"action": {"mean": 0}}},
        create_tasks=called("task", "a task"),
        sample_actions=called("sample", np.arange(28.0).reshape(1, 4, 7)),
    )
    for name in ("octo", "octo.model"):
        module(name)
    module("octo.model.octo_model", OctoModel=SimpleNamespace(load_pretrained=lambda name: octo))
    module("jax", random=SimpleNamespace(PRNGKey=lambda seed: (seed,), split=lambda key: ((*key, 0), (*key, 1))))
    rdt = SimpleNamespace(
        reset=called("reset"),
        encode_instruction=called("encode", "words"),
        step=called("step", Tensor(np.arange(64.0 * 8).reshape(1, 64, 8))),
    )
    statistics = {"state_min": None}
    module("scripts")
    module("scripts.maniskill_model", DATA_STAT=statistics, create_model=called("create", rdt))
    sys.modules["scripts"].maniskill_model = sys.modules["scripts.maniskill_model"]  # type: ignore[attr-defined]
    return SimpleNamespace(calls=calls, statistics=statistics)


def test_openvla_is_asked_in_its_own_words(packages, served):
    """Its prompt in small letters, the name of its statistics, the middle of the picture in its size; its action is the
    environment's, a tenth of a metre for 1. Through the protocol too."""
    policy = Remote(served(OpenVLA("weights", "cutcal")))
    policy.reset(0)
    found = policy.act({**OBS, "images": {"front": RAMP}}, "Cut the Plum")
    assert found == pytest.approx(from_gym_action(np.arange(7.0), POSE[3])) and found[1] == pytest.approx(0.1)
    asked = dict((name, (args, how)) for name, args, how in packages.calls)
    prompt, picture = asked["processor"][0]
    assert prompt == "In: What action should the robot take to cut the plum?\nOut:"
    assert asked["predict"][1] == {"pixels": 1, "unnorm_key": "cutcal", "do_sample": False}
    shown = np.array(picture)[0, :, 0].astype(float)
    assert shown.shape == (100,) and (shown[0], shown[-1]) == pytest.approx((6.0, 193.0), abs=1.5)


def test_openvla_has_the_statistics_of_its_fine_tuning(packages, tmp_path):
    """Those beside the weights, or of a file; the only key without one; a key that is none is one line."""
    (tmp_path / "dataset_statistics.json").write_text(json.dumps({"own": {"action": {}}}))
    beside = OpenVLA(str(tmp_path), "")
    assert beside.key == "own" and list(beside.network.norm_stats) == ["own"]
    other = tmp_path / "other.json"
    other.write_text(json.dumps({"a": {}, "b": {}}))
    assert OpenVLA("weights", "b", statistics=str(other)).key == "b"
    for key in ("", "cutcal"):
        with pytest.raises(CutcalError, match="its statistics are of a, b"):
            OpenVLA("weights", key, statistics=str(other))
    with pytest.raises(CutcalError, match="cannot be read"):
        OpenVLA("weights", "b", statistics=str(tmp_path / "none.json"))


class Watching:
    """Four actions at a time, and a memory of two pictures."""

    name, action, cameras, history = "watching", "pose", ("front",), 2

    def __init__(self) -> None:
        self.seen: list[int] = []
        self.asked: list[list[int]] = []

    def reset(self, seed, instruction):
        """Forget."""
        self.seen = []

    def see(self, images):
        """Another picture."""
        self.seen.append(int(images["front"][0, 0, 0]))

    def act(self, instruction, pose, joints, images):
        """What was seen so far."""
        self.see(images)
        self.asked.append(self.seen[-2:])
        return np.zeros((4, 7))


def test_a_policy_with_a_memory_is_sent_the_picture_of_the_step_before(served):
    """Of ten steps it is asked in three: each time it has this step's picture and that of the step before, not of the
    last question; nothing of the last episode."""
    model = Watching()
    policy = Remote(served(model))
    for _ in range(2):
        policy.reset(0)
        for step in range(9):
            policy.act({**OBS, "images": {"front": np.full((4, 4, 3), step, np.uint8)}}, "cut")
    assert model.asked == 2 * [[0], [3, 4], [7, 8]]


def test_octo_remembers_a_picture(packages):
    """Two steps in a window, the first one masked; sizes of its pictures; another key for each question; nothing left
    after a reset."""
    model = Octo("weights", "cutcal")
    model.reset(3, "cut the plum")
    for _ in range(2):
        found = model.act("cut the plum", POSE, JOINTS, SEEN)
        assert found == pytest.approx(from_gym_action(np.arange(28.0).reshape(4, 7), POSE[3]))
    first, second = [(args[0], how) for name, args, how in packages.calls if name == "sample"]
    assert first[0]["image_primary"].shape == (1, 2, 256, 256, 3) and first[0]["image_wrist"].shape == (
        1,
        2,
        128,
        128,
        3,
    )
    assert [g["timestep_pad_mask"].tolist() for g in (first[0], second[0])] == [[[False, True]], [[True, True]]]
    assert first[1]["rng"] != second[1]["rng"] and first[1]["unnormalization_statistics"] == {"mean": 0}
    model.reset(3, "cut the plum")
    assert len(model.seen) == 0 and model.history == 2
    model.see(SEEN)
    assert len(model.seen) == 1


def test_rdt_gives_joint_targets(packages, tmp_path):
    """Eight of nine joints, six pictures of which two are there at most, every fourth of its interpolated actions, the
    statistics of the export in place of its own."""
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "base.yaml").write_text("common: {}")
    (tmp_path / "statistics.json").write_text(json.dumps({"state_min": [0.0] * 8}))
    model = RDT("w.pt", str(tmp_path), str(tmp_path / "statistics.json"))
    assert packages.statistics["state_min"] == [0.0] * 8
    model.reset(5, "cut the plum")
    found = model.act("cut the plum", POSE, JOINTS, SEEN)
    assert found.shape == (16, 8) and found[1, 0] == 4 * 8
    (state, shown, words), _ = next((args, how) for name, args, how in packages.calls if name == "step")
    assert state.numpy().shape == (1, 8) and words == "words"
    assert [one is None for one in shown] == [True, True, True, False, True, True]
    model.see(SEEN)
    model.act("cut the plum", POSE, JOINTS, SEEN)
    (_, shown, _), _ = [(args, how) for name, args, how in packages.calls if name == "step"][-1]
    assert [one is None for one in shown] == [False, True, True, False, True, True] and model.history == 2
    with pytest.raises(ValueError, match="--world intsim"):
        model.act("cut", POSE, None, SEEN)


def test_the_adapters_command_line(monkeypatch, capsys):
    """What is not installed and what is missing is one line; a model is served until Ctrl-C."""
    monkeypatch.setitem(sys.modules, "transformers", None)
    assert vla_adapters.main(["openvla", "--weights", "w"]) == 1
    assert "is not installed" in capsys.readouterr().err
    assert vla_adapters.main(["rdt", "--weights", "w"]) == 1
    assert "--root" in capsys.readouterr().err
    monkeypatch.setattr(vla_adapters, "load_model", lambda args: Counting())
    monkeypatch.setattr(Server, "serve_forever", lambda self: (_ for _ in ()).throw(KeyboardInterrupt))
    assert vla_adapters.main(["octo", "--weights", "w", "--port", "0"]) == 0
    assert "answers at http://127.0.0.1:" in capsys.readouterr().err
