"""``--decimal``: a number such as 1,234 is one and a bit, or a thousand and more."""

from __future__ import annotations

from pathlib import Path

import pytest

from cutcal.main import main


@pytest.mark.parametrize(("mark", "unit"), [(",", "N"), (".", "mN")])
def test_it_says_which(mark: str, unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Both ways the peak that ``--check`` names is the same: 1,234 mN with commas for thousands is 1,234 N."""
    force = [1000] * 100 + [1000 + min(k, 60, 200 - k) * 8876 // 60 for k in range(200)]
    rows = [f"{10 * k};{f // 1000},{f % 1000:03d}" for k, f in enumerate(force)]
    path = tmp_path / "cut.csv"
    path.write_text("\n".join([f"t_ms;F_{unit}", *rows]))
    argv = ["calibrate", "--food", "banana", "--trace", str(path), "--speed", "0.02", "--check"]
    assert main([*argv, "--decimal", mark]) == 0
    (line,) = [text for text in capsys.readouterr().out.splitlines() if text.startswith("peak")]
    value, shown = line.split()[1:3]
    assert (float(value), shown) == (pytest.approx(8.876, rel=0.02), "N")
