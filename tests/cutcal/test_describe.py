"""``calibrate --check``: how a trace is read, before anything is simulated."""

from __future__ import annotations

from pathlib import Path

from cutcal.main import main
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


def test_check_refuses_what_a_fit_would_refuse(tmp_path: Path, capsys) -> None:
    """A record without contact is one line; a study has no check."""
    path = tmp_path / "flat.csv"
    path.write_text("time_s,force_N\n" + "\n".join(f"{0.01 * k},25.{k % 2}" for k in range(400)))
    assert main(["calibrate", "--check", "--food", "banana", "--trace", str(path)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("cutcal: flat.csv") and error.count("\n") == 1
    assert main(["calibrate", "--check", "--config", str(path)]) == 1
    assert "--check is for one trace" in capsys.readouterr().err
