"""The figure of a stability map: every status has a mark of its own, and what must be stable and is not is ringed."""

from __future__ import annotations

from reports.studies.stability import MARKERS, write_figure
from studies.stability.result import REASONS, CellResult


def drawn(folder, cells) -> bytes:
    """The figure of these cells."""
    write_figure(cells, folder)
    return (folder / "stress.svg").read_bytes()


def one(status, reason="", *, physical=False, family="dt and nu", **values):
    """A cell of a map."""
    place = {"dt_over_limit": 0.7, "nu": 0.4} | values
    ends = {"status": status, "reason": reason, "message": ""}
    return CellResult(name=f"{family}: x", family=family, values=place, physical=physical, forced=False, **ends)


def test_every_reason_has_a_mark_of_its_own():
    """No reason is drawn as another one or cannot be drawn; they differ without colour."""
    assert set(REASONS) - {"cfl"} | {"stable", "unexplained"} == set(MARKERS)
    assert len({(look["marker"], look.get("mfc")) for look in MARKERS.values()}) == len(MARKERS)


def test_figure_shows_every_status(tmp_path):
    """All statuses in a plane and in the list, and a map of one cell, can be drawn; letters are paths."""
    cells = [one("stopped", reason, dt_over_limit=k / 10) for k, reason in enumerate(REASONS)]
    cells += [one("refused", "cfl"), one("unexplained", "odd"), one("stable"), one("stable", family="start")]
    figure = drawn(tmp_path, [c for c in cells if c.reason not in ("cfl", "refused") or c.status == "refused"])
    assert figure.startswith(b"<?xml")
    assert b"<text" not in figure
    assert drawn(tmp_path, [one("stable")]).startswith(b"<?xml")


def test_what_must_be_stable_is_ringed(tmp_path):
    """The same stop is drawn differently where the cell is a physical one."""
    plain, ringed = (drawn(tmp_path, [one("stopped", "inverted", physical=p)]) for p in (False, True))
    assert len(ringed) > len(plain)
