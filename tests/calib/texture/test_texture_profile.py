"""Texture profiles: bodies whose profile is known, machines of all kinds, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from calib.errors import TraceError
from calib.texture.bites import moving_mean
from calib.texture.plate_record import PlateColumns, read_record, read_records
from calib.texture.texture_profile import area, texture_profile, work
from tests.calib.texture.made_bites import DEPTH, HEIGHT, record, two_bites, write

PLAIN = PlateColumns()


@pytest.mark.parametrize(("start", "end"), [(0.5, 2.5), (1.0, 3.0), (1.2, 1.7)])
def test_integrals_reach_from_one_time_to_the_other(start, end):
    """A load that grows with time, and a way that grows twice as fast: both ends count, between samples and on them."""
    time = np.arange(5.0)
    grows = record(time, 2.0 * time, time)
    exact = 0.5 * (end**2 - start**2)
    assert (area(grows, start, end), work(grows, start, end)) == pytest.approx((exact, 2.0 * exact))


@pytest.mark.parametrize("power", [1.0, 2.5])
def test_an_elastic_body_gives_all_back(power):
    """Cohesiveness, springiness and resilience 1 within 1 %, hardness exact, nothing adheres, gum is hardness."""
    time, way = two_bites()
    profile, remarks = texture_profile(record(time, way, 8.0 * (way / DEPTH) ** power))
    assert profile.hardness_N == profile.second_hardness_N == 8.0
    found = [profile.cohesiveness, profile.springiness, profile.resilience, profile.work_resilience]
    assert found == pytest.approx([1.0] * 4, rel=0.01)
    assert profile.adhesiveness_Ns == 0.0 and remarks == []
    assert profile.chewiness_N == pytest.approx(8.0, rel=0.01)


def test_a_viscous_body_gives_nothing_back():
    """A film between plates (Stefan: load = c speed / (1 - strain)^3) pulls as it pressed: cohesiveness 1, no
    resilience, and an adhesiveness that is the integral over the way up, within 1 %."""
    time, way = two_bites()
    phase = (time - 0.2) % 2.2  # of a bite: down for 1 s, up for 1 s, at rest for 0.2 s
    speed = np.select([(time < 0.2) | (phase > 2.0), phase < 1.0], [0.0, DEPTH], -DEPTH)
    load = 100.0 * speed / (1.0 - way / HEIGHT) ** 3
    profile, _ = texture_profile(record(time, way, load), trigger=0.1)
    assert profile.cohesiveness == pytest.approx(1.0, rel=0.01)
    assert profile.resilience == pytest.approx(0.0, abs=0.01)
    # c times the integral of (1 - x / H)^-3 over the way to half the height is c H (2^2 - 1) / 2
    assert profile.adhesiveness_Ns == pytest.approx(100.0 * HEIGHT * 1.5, rel=0.01)


def test_a_body_that_stays_deformed():
    """Springiness is the part of the depth that is left, from trigger to peak; half the stiffness halves the areas."""
    time, way = two_bites()
    second = time > time[-1] / 2
    load = 8.0 * np.where(second, 0.5 * np.maximum(way - 0.4 * DEPTH, 0.0) / (0.6 * DEPTH), way / DEPTH)
    profile, _ = texture_profile(record(time, way, load))
    # contact is at 5 % of 8 N: at 5 % of the depth, and at 40 % and a tenth of the other 60 %
    assert profile.springiness == pytest.approx(0.54 / 0.95, rel=0.01)
    assert profile.cohesiveness == pytest.approx(0.5 * 0.6 * (1 - 0.1**2) / (1 - 0.05**2), rel=0.01)
    assert (profile.hardness_N, profile.second_hardness_N) == (8.0, 4.0)


def test_time_and_load_scale_out():
    """A hundred times as slow and three times as stiff: the ratios are the same, hardness three times."""
    profiles = []
    for descent, scale in ((1.0, 1.0), (100.0, 3.0)):
        time, way = two_bites(descent)
        load = scale * (way / DEPTH) ** 2 * np.where(np.gradient(way) < 0, 0.3, 1.0)
        profiles.append(texture_profile(record(time, way, load))[0])
    one, other = profiles
    assert other.hardness_N == pytest.approx(3 * one.hardness_N)
    for name in ("cohesiveness", "springiness", "resilience"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-3)


def test_ringing_moves_neither_contact_nor_areas():
    """A ringing of 5 % of the peak, as fast plates have, moves the ratios by less than 3 %."""
    time, way = two_bites()
    load = 4.0 * way / DEPTH
    calm = texture_profile(record(time, way, load))[0]
    rung = texture_profile(record(time, way, load + 0.2 * np.sin(2 * np.pi * 40 * time)))[0]
    for name in ("cohesiveness", "springiness", "resilience"):
        assert getattr(rung, name) == pytest.approx(getattr(calm, name), rel=0.03)


def test_moving_mean_of_a_line_is_the_line():
    """Exact for lines on uneven times, also at the ends, and a constant has no other mean."""
    time = np.sort(np.random.default_rng(1).uniform(0, 1, 50))
    assert moving_mean(time, 3 * time - 1, 0.2) == pytest.approx(3 * time - 1, abs=1e-12)
    step = moving_mean(time, (time > 0.5).astype(float), 0.2)
    assert 0.2 < step[np.argmin(abs(time - 0.5))] < 0.8


def test_a_rheometers_file_is_read_as_it_is(tmp_path):
    """Tabs, micrometres and a gap that falls give the way in metres and the height; commas and millimetres the same."""
    time, way = two_bites()
    made = record(time, way, 8.0 * way / DEPTH)
    read = read_record(write(tmp_path / "a.txt", made), PLAIN)
    assert read.gap == pytest.approx(HEIGHT) and read.height(None) == read.gap and read.notes == ()
    np.testing.assert_allclose(read.way, way, atol=1e-9)
    np.testing.assert_allclose(read.load, made.load, atol=1e-6)
    rows = zip(time, -1e3 * way, -made.load, strict=True)
    (tmp_path / "b.csv").write_text("t_s,way_mm,load_N\n" + "".join(f"{t},{x},{f}\n" for t, x, f in rows))
    other = read_record(tmp_path / "b.csv", PlateColumns(compression="way_mm", sign="-"))
    np.testing.assert_allclose(other.way, way, atol=1e-9)
    assert other.gap is None and any("taken as negative" in note for note in other.notes)
    assert texture_profile(other)[0].hardness_N == 8.0


def test_a_way_that_is_recorded_late_is_said():
    """A gap that lags by 50 ms at a dwell goes on behind the peak: no work is taken from it, and the lag is told."""
    time, way = two_bites(rest=0.2)
    dwell = np.interp(time, [0, 0.2, 1.2, 1.5, 2.5], [0, 0, DEPTH, DEPTH, 0])
    twice = np.where(time < 2.5, dwell, np.interp(time - 2.5, [0, 0.2, 1.2, 1.5, 2.5], [0, 0, DEPTH, DEPTH, 0]))
    load = 8.0 * twice / DEPTH - 0.5 * (time % 2.5 > 1.2) * (twice > 0)
    late = record(time, np.interp(time - 0.05, time, twice), np.maximum(load, 0.0))
    profile, remarks = texture_profile(late)
    assert np.isnan(profile.work_resilience)
    text = next(remark.text for remark in remarks if remark.kind == "late")
    assert "50 ms late" in text or "51 ms late" in text
    assert [remark.kind for remark in remarks] == ["late", "dwell"]


def test_what_is_refused(tmp_path):
    """Once pressed, too few samples, a height that is not known, a file twice, a distance that falls: one clear line
    each."""
    time, way = two_bites()
    once = time < time[-1] / 2
    with pytest.raises(TraceError, match="presses once, and a texture profile has two"):
        texture_profile(record(time[once], way[once], way[once]))
    few = slice(None, None, 40)
    with pytest.raises(TraceError, match="samples between contact and peak of bite 1"):
        texture_profile(record(time[few], way[few], way[few]))
    with pytest.raises(TraceError, match="not above the trigger of 9 N"):
        texture_profile(record(time, way, 8.0 * way / DEPTH), trigger=9.0)
    path = write(tmp_path / "a.txt", record(time, way, way))
    with pytest.raises(TraceError, match="a: given 2 times"):
        read_records([path, path], PLAIN)
    text = path.read_text()
    path.write_text(text.replace("gap_um", "distance_um"))
    with pytest.raises(TraceError, match=r"distance_um: falls as the plates approach; rename the column to gap_um"):
        read_record(path, PLAIN)
    path.write_text(text.replace("gap_um", "gap_mm"))
    assert read_record(path, PLAIN).gap == pytest.approx(1e3 * HEIGHT)
    with pytest.raises(TraceError, match=r"the plate goes 5 m, which is not less than the height of 0.01 m"):
        read_record(path, PLAIN).height(0.01)
