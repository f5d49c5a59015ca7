"""Files of cutcal that another distribution has overwritten are found and named."""

from __future__ import annotations

import base64
import hashlib
from importlib import metadata
from pathlib import Path

from cutcal import doctor
from cutcal.installation import Overwritten, overwritten


def installed(folder: Path, name: str, files: dict[str, str]) -> None:
    """Install a distribution as pip does: its files, overwriting what is there, and a RECORD of their digests."""
    rows = []
    for path, content in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(content)
        digest = base64.urlsafe_b64encode(hashlib.sha256(content.encode()).digest()).rstrip(b"=").decode()
        rows.append(f"{path},sha256={digest},{len(content)}")
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "RECORD").write_text("\n".join([*rows, f"{info.name}/RECORD,,"]))


def looked_at(folder: Path) -> Overwritten:
    """What is found in a folder of installed packages."""
    return overwritten(metadata.distributions(path=[str(folder)]), folder)


OWN = {"calib/__init__.py": "a = 1\n", "reports/study.py": "b = 2\n", "reports/__init__.py": ""}


def test_a_sound_installation_is_sound(tmp_path):
    """Other distributions beside it, in packages of their own, are nobody's concern."""
    installed(tmp_path, "cutcal", OWN)
    installed(tmp_path, "robotframework", {"robot/__init__.py": "c = 3\n"})
    assert not looked_at(tmp_path)


def test_an_overwritten_package_is_named_with_who_did_it(tmp_path):
    """Installed later, the other one has its files in our package: which files, and whose."""
    installed(tmp_path, "cutcal", OWN)
    installed(tmp_path, "prettyreports", {"reports/__init__.py": "d = 4\n", "prettyreports.py": ""})
    found = looked_at(tmp_path)
    assert found.altered == ("reports/__init__.py",) and found.claimed == {"prettyreports": ("reports/__init__.py",)}
    assert "prettyreports installs reports/__init__.py as well" in found.sentence() and "of its own" in found.sentence()


def test_a_package_that_only_claims_our_files_is_named_too(tmp_path):
    """Installed before us, its files are gone; but when it is uninstalled, ours go with it."""
    installed(tmp_path, "prettyreports", {"reports/__init__.py": "d = 4\n"})
    installed(tmp_path, "cutcal", OWN)
    found = looked_at(tmp_path)
    assert found.altered == () and list(found.claimed) == ["prettyreports"]


def test_a_file_that_is_gone_or_edited_is_named(tmp_path):
    """With nobody else about, what is damaged is still said; many files are counted."""
    installed(tmp_path, "cutcal", {f"calib/m{k}.py": str(k) for k in range(6)})
    for k in range(5):
        (tmp_path / f"calib/m{k}.py").write_text("damaged")
    (tmp_path / "calib/m0.py").unlink()
    found = looked_at(tmp_path)
    assert len(found.altered) == 5 and "and 2 more is not what cutcal installed" in found.sentence()


def test_doctor_says_it(monkeypatch):
    """One line of the examination; where these tests run nothing is overwritten."""
    assert doctor.own_packages().state == "ok"
    found = Overwritten({"reports": "/elsewhere"}, (), {})
    monkeypatch.setattr(doctor, "overwritten", lambda: found)
    line = doctor.own_packages()
    assert line.state == "fail" and "Python finds reports in /elsewhere" in line.words
