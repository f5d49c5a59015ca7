"""``cutcal press``: modes, documents, reports, and options that are of another mode."""

from __future__ import annotations

import json

import numpy as np
import pytest

from calib.texture.bite_path import BitePath
from calib.texture.prony_series import PronySeries
from calib.texture.quasi_linear import QuasiLinearLaw
from calib.texture.texture_evaluation import _several
from cutcal.main import main
from tests.calib.documents import valid
from tests.calib.texture.made_bites import DEPTH, HEIGHT, held, record, two_bites, write


def bite(path, hardness, descent=1.0):
    """A file of two bites with this hardness, whose second one is 0.9 of the first."""
    time, way = two_bites(descent)
    load = hardness * way / DEPTH * np.where(time > time[-1] / 2, 0.9, 1.0)
    return str(write(path, record(time, way, load)))


def test_a_texture_profile_end_to_end(tmp_path, capsys):
    """Two directions at two speeds: groups, ratios with intervals, a valid document that is printed too, curves, a
    PDF."""
    along = [bite(tmp_path / f"a{k}.tsv", 2.0 + 0.1 * k, d) for d in (1.0, 10.0) for k in ([0, 1] if d < 2 else [2, 3])]
    across = [bite(tmp_path / f"b{k}.tsv", 4.0 + 0.2 * k) for k in (0, 1)]
    out = tmp_path / "out"
    assert main(["press", "tpa", "--trace", *along, "--across", *across, "--out", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    document = valid(json.loads((out / "tpa.json").read_text()), "tpa")
    assert printed == document
    assert [(g["direction"], len(g["repeats"])) for g in document["groups"]] == [
        ("along", 2),
        ("along", 2),
        ("across", 2),
    ]
    assert document["groups"][0]["hardness_N"]["mean"] == pytest.approx(2.05, rel=1e-3)
    assert document["groups"][0]["cohesiveness"]["mean"] == pytest.approx(0.9, rel=0.01)
    ratio = next(r for r in document["ratios"] if r["quantity"] == "hardness_N")
    assert ratio["value"] == pytest.approx(0.5, rel=1e-3) and ratio["low"] <= 0.5 <= ratio["high"]
    assert (out / "report.pdf").read_bytes().startswith(b"%PDF")
    assert len((out / "curves.csv").read_text().splitlines()) > 100


def test_a_law_end_to_end(tmp_path, capsys):
    """Three speeds, two specimens each of laws that differ: a law, three predictions, exit code 0, what is predicted
    in the curves."""
    laws = [
        QuasiLinearLaw(f * 1e5, stiffening=4.0, equilibrium=0.1, power=p, damage=0.0)
        for f, p in ((0.8, 0.25), (1.2, 0.35))
    ]
    paths = []
    for descent in (0.5, 3.0, 20.0):
        time, strain = BitePath(descent, 0.0, 2.2 * descent, 0.5).history()
        fine = np.linspace(time[0] - 0.2 * descent, time[-1], 1500)
        way = HEIGHT * np.interp(fine, time, strain)
        for k, law in enumerate(laws):
            load = 5e-5 * np.interp(fine, time, law.stress(time, strain))
            paths.append(str(write(tmp_path / f"s{descent:g}_{k}.tsv", record(fine - fine[0], way, load))))
    out = tmp_path / "out"
    size = ["--diameter", str(np.sqrt(4 * 5e-5 / np.pi))]
    assert main(["press", "tpa", "--trace", *paths, *size, "--law", "--out", str(out)]) == 0
    assert "law (only): E 1" in capsys.readouterr().out
    document = valid(json.loads((out / "tpa.json").read_text()), "tpa")
    (found,) = document["laws"]
    assert [one["extrapolated"] for one in found["left_out"]] == [True, False, True] and document["passed"]
    parameters = {one["name"]: one for one in found["parameters"]}
    assert parameters["E_Pa"]["value"] == pytest.approx(1e5, rel=0.2)
    assert parameters["E_Pa"]["low"] < 1e5 < parameters["E_Pa"]["high"]
    assert (out / "curves.csv").read_text().splitlines()[1].endswith("predicted_N")


def one_repeat_a_speed(folder, descents=(0.5, 3.0, 20.0), *, gap=True, direction="s"):
    """Files of one specimen a speed; without a gap they have a distance of the plate."""
    law = QuasiLinearLaw(1e5, stiffening=4.0, equilibrium=0.1, power=0.3, damage=0.0)
    paths = []
    for descent in descents:
        time, strain = BitePath(descent, 0.0, 2.2 * descent, 0.5).history()
        fine = np.linspace(time[0] - 0.2 * descent, time[-1], 1500)
        way, load = HEIGHT * np.interp(fine, time, strain), 5e-5 * np.interp(fine, time, law.stress(time, strain))
        path = folder / f"{direction}{descent:g}.tsv"
        if gap:
            write(path, record(fine - fine[0], way, load))
        else:
            rows = "".join(
                f"{t:.6g},{1e3 * x:.6g},{f:.6g}\n" for t, x, f in zip(fine - fine[0], way, load, strict=True)
            )
            path.write_text("time_s,compression_mm,load_N\n" + rows)
        paths.append(str(path))
    return paths


def test_one_repeat_a_speed_is_not_judged(tmp_path, capsys):
    """Exit code 0 and lines that say why; a height is needed where no gap is recorded, and --height gives it."""
    words = ["press", "tpa", "--trace", *one_repeat_a_speed(tmp_path, gap=False), "--diameter", "8mm", "--law"]
    assert main([*words, "--out", str(tmp_path / "none")]) == 1
    assert "a law needs the height of each specimen" in capsys.readouterr().err
    out = tmp_path / "out"
    assert main([*words, "--height", "10mm", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    name = "by the law of the other speeds: quantities of 5 outside the scatter of the repeats"
    assert shown.count("not judged") == shown.count(f"{name}: one repeat has no scatter") == 3 and "FAIL" not in shown
    document = valid(json.loads((out / "tpa.json").read_text()), "tpa")
    assert [line["passed"] for line in document["verdicts"]] == [None] * 3 and document["passed"]
    assert (out / "report.pdf").read_bytes().startswith(b"%PDF")
    assert main(["press", "tpa", *words[2:-1], "--height", "4mm", "--out", str(tmp_path / "low")]) == 1
    assert "which is not less than the height of 0.004 m" in capsys.readouterr().err


def test_words_agree_with_numbers(tmp_path, capsys):
    """One speed and one other record are no plural, quantities have names, and a speed has one name in both
    directions."""
    along, across = (one_repeat_a_speed(tmp_path, times, direction=d) for d, times in
                     (("a", (0.5, 3.0)), ("b", (0.48, 3.2))))  # fmt: skip
    words = ["press", "tpa", "--trace", *along, "--across", *across, "--out", str(tmp_path / "out")]
    assert main(words) == 0
    captured = capsys.readouterr()
    assert "along / across, hardness: " in captured.out and "hardness_N" not in captured.out
    names = [one["name"] for one in json.loads((tmp_path / "out" / "tpa.json").read_text())["groups"]]
    assert names == ["along 0.49 s", "along 3.1 s", "across 0.49 s", "across 3.1 s"]
    one = ["press", "tpa", "--trace", along[0], "--diameter", "8mm", "--law", "--out", str(tmp_path / "one")]
    assert main(one) == 1 and "a law of rate to 1 speed, direction" in capsys.readouterr().err
    assert _several(1, "other record") == "1 other record" and _several(2, "other record") == "2 other records"


def test_a_relaxation_end_to_end(tmp_path, capsys):
    """Two specimens: the common series and the modulus, a valid document, a PDF; a ringing load does not pass."""
    paths = []
    for k in (0, 1):
        made = held(PronySeries((0.3, 0.2), (0.5, 8.0)), noise=0.005, seed=k)
        paths.append(str(write(tmp_path / f"r{k}.tsv", made)))
    out = tmp_path / "out"
    assert main(["press", "relax", "--trace", *paths, "--diameter", "0.02", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    document = valid(json.loads((out / "relax.json").read_text()), "relax")
    assert document["count"] == 2 and document["passed"] and document["chosen"]
    area = np.pi / 4 * 0.02**2
    assert document["E0_Pa"]["mean"] == pytest.approx(2000.0 * 0.01 / area, rel=0.02)
    assert [b["time_s"] for b in document["series"]] == pytest.approx([0.5, 8.0], rel=0.05)
    assert "relaxes in 0.5" in shown and (out / "report.pdf").read_bytes().startswith(b"%PDF")

    made = held(PronySeries((0.3,), (2.0,)))
    rung = record(made.time, made.way, made.load * (1 + 0.1 * np.sin(9 * made.time)))
    path = str(write(tmp_path / "rung.tsv", rung))
    assert main(["press", "relax", "--trace", path, "--diameter", "0.02", "--out", str(tmp_path / "b")]) == 2
    assert "FAIL" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["tpa", "--nu", "0.4"], "--nu is an option of press compress, not of tpa"),
        (["relax", "--across", "b.csv"], "--across is an option of press tpa, not of relax"),
        (["compress", "--trigger", "0.1"], "--trigger is an option of press relax and tpa, not of compress"),
        (["relax"], "the area under the plate is missing"),
        (["tpa", "--arch", "cuda"], "press tpa simulates nothing"),
        (["tpa"], "no such file"),
        (["taste"], "there is no mode 'taste'"),
    ],
)
def test_what_is_not_meant(words, said, tmp_path, capsys):
    """One clear line, exit code 1, nothing written."""
    assert main(["press", words[0], "--trace", "none.csv", *words[1:], "--out", str(tmp_path / "out")]) == 1
    line = capsys.readouterr().err
    assert said in line and line.count("\n") == 1 and not (tmp_path / "out").exists()


def test_compress_is_a_mode(capsys):
    """``press compress`` asks for what ``compress`` asks for; what it writes is tested with that."""
    assert main(["press", "compress", "--trace", "none.csv", "--height", "0.02", "--diameter", "0.02"]) == 1
    assert "--nu is missing" in capsys.readouterr().err
