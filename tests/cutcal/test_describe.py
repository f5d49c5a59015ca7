"""``calibrate --check``: how a trace is read, before anything is simulated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import image as plt_image

from calib.io.wording import as_arguments
from cutcal import Calibration
from cutcal.main import main
from mpm.scene.errors import CutcalError
from tests.calib.made_cuts import made_cut, plain_rows, text_of
from tests.calib.made_outlines import half_ellipsoid, mesh
from tests.data_dir import ROOT

TRACE = ROOT / "force_data" / "banana_reconstructed.csv"


def test_check_says_what_a_fit_would_start_from(tmp_path: Path, capsys, monkeypatch) -> None:
    """Columns, tare, contact, stroke and peak of the bundled trace (its header), the specimen, what is fitted; no
    folder is made."""
    monkeypatch.chdir(tmp_path)
    assert (
        main(["calibrate", "--check", "--food", "banana", "--trace", str(TRACE), "--height", "0.03", "--fit", "E,R"])
        == 0
    )
    said = dict(line.split(None, 1) for line in capsys.readouterr().out.splitlines() if not line.startswith("note"))
    assert said["trace"] == "banana_reconstructed.csv, reconstructed; time from time_s, force from force_N"
    assert said["subtracted"].startswith("level before contact 25") and said["contact"].startswith("at 1")
    assert said["stroke"].startswith("30 mm, from the food's height") and said["peak"].startswith("12.5")
    assert said["specimen"].startswith("cylinder") and said["specimen"].split(" mm")[0].endswith("30")
    assert said["fitted"] == "E, R" and said["budget"].startswith("100 simulations")
    assert list(tmp_path.iterdir()) == []


def test_check_names_the_file_of_an_outline(tmp_path: Path, capsys) -> None:
    """The specimen is that of the mesh, with its sizes; a size beside it is one line."""
    path = mesh(tmp_path / "food.stl", *half_ellipsoid(15, 30, 30))
    argv = ["calibrate", "--check", "--food", "banana", "--trace", str(TRACE), "--outline", str(path), "--scale", "mm"]
    assert main(argv) == 0
    said = capsys.readouterr().out
    assert "outline of food.stl (mesh, mm, z up, y across), 60 x 30 x 30 mm" in said
    assert "--width" not in said and "--length" not in said
    assert main([*argv, "--width", "30mm"]) == 1
    assert capsys.readouterr().err.startswith("cutcal: --width beside --outline: food.stl says how large")


def test_check_refuses_what_a_fit_would_refuse(tmp_path: Path, capsys) -> None:
    """A record without contact is one line; a study has no check."""
    path = tmp_path / "flat.csv"
    path.write_text("time_s,force_N\n" + "\n".join(f"{0.01 * k},25.{k % 2}" for k in range(400)))
    assert main(["calibrate", "--check", "--food", "banana", "--trace", str(path)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("cutcal: flat.csv") and error.count("\n") == 1
    assert main(["calibrate", "--check", "--config", str(path)]) == 1
    assert "--check is for one trace" in capsys.readouterr().err


def test_check_draws_the_record_as_it_was_read(tmp_path: Path, capsys) -> None:
    """A PNG of the size that is stated; a value that stands out is in it, and the cut is still seen. Another kind of
    file, and a folder that is not there, are one line."""
    cut = made_cut()
    rows = plain_rows(cut.but(force=np.where(np.arange(640) == 150, 9999.0, cut.force)))
    path, png = tmp_path / "cut.csv", tmp_path / "record.png"
    path.write_text(text_of("time_s,force_N,position_m", rows))
    check = ["calibrate", "--food", "banana", "--trace", str(path), "--check"]
    assert main([*check, str(png)]) == 0
    assert f"picture     {png}" in capsys.readouterr().out
    pixels = plt_image.imread(png)
    assert pixels.shape[:2] == (605, 880) and 0.02 < np.mean(pixels[..., :3].min(axis=-1) < 0.5) < 0.3
    for name, says in (("record.pdf", "is a PNG"), ("none/record.png", "cannot be written")):
        assert main([*check, str(tmp_path / name)]) == 1
        assert says in capsys.readouterr().err


def test_cells_too_large_to_screen_on_are_told_from_those_that_were_asked_for(capsys) -> None:
    """Cells of 8 mm would do for a cut of 33 mm; those of the screening are larger, and the error names both."""
    argv = ["calibrate", "--food", "banana", "--trace", str(TRACE), "--check", "--dx"]
    assert main([*argv, "8mm"]) == 1
    assert "dx = 8 mm: a calibration screens on larger cells" in (said := capsys.readouterr().err)
    assert "33 mm is under 4 cells of 10.6667 mm; use a smaller dx" in said and said.count("\n") == 1
    assert main([*argv, "12mm"]) == 1 and "screens" not in capsys.readouterr().err


def test_python_says_the_same(tmp_path: Path, capsys) -> None:
    """``Calibration.check`` gives the text of ``--check``, with arguments in place of options, and draws the record."""
    made = Calibration("banana", TRACE, height=0.03, fit=["E", "R"])
    said = made.check(tmp_path / "record.png")
    assert (tmp_path / "record.png").read_bytes().startswith(b"\x89PNG")
    argv = ["calibrate", "--food", "banana", "--trace", str(TRACE), "--height", "0.03", "--fit", "E,R"]
    assert main([*argv, "--check", str(tmp_path / "record.png")]) == 0
    assert said == as_arguments(capsys.readouterr().out.rstrip("\n"))
    with pytest.raises(CutcalError, match=r"^check .*record.pdf: the picture of the record is a PNG"):
        made.check(tmp_path / "record.pdf")
    with pytest.raises(CutcalError, match="flat.csv"):
        (tmp_path / "flat.csv").write_text("time_s,force_N\n" + "\n".join(f"{0.01 * k},25.{k % 2}" for k in range(400)))
        Calibration("banana", tmp_path / "flat.csv").check()


def test_one_of_several_cuts_is_chosen(tmp_path: Path, capsys) -> None:
    """Without a choice the file is refused; --cut takes one, --all says how each is read."""
    cuts = [made_cut(peak=12.0), made_cut(peak=9.0, seed=1)]
    rows = [
        (f"{t + 3.2 * k:.4f}", *r) for k, c in enumerate(cuts) for (_, *r), t in zip(plain_rows(c), c.time, strict=True)
    ]
    path = tmp_path / "cuts.csv"
    path.write_text(text_of("time_s,force_N,position_m", rows))
    check = ["calibrate", "--food", "banana", "--trace", str(path), "--check"]
    assert main(check) == 1 and "holds 2 cuts" in capsys.readouterr().err
    assert main([*check, "--cut", "2"]) == 0 and "peak        8.9" in capsys.readouterr().out
    assert main([*check, "--all"]) == 0
    said = capsys.readouterr().out
    assert "peak        11.8" in said and "peak        8.9" in said and "\ncut2\n" in said
    assert main([*check, "--all", "--cut", "1"]) == 1
    for name in (".", "record.pdf"):
        assert main([*check, name, "--all"]) == 1
        assert f"--check {name}: the picture of the record is a PNG" in capsys.readouterr().err
