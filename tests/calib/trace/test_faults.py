"""Faults in a record: each is named with row and time, and repaired with its doubt, or refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.errors import TraceError
from calib.problem.nuisance import nuisances, sensor_of
from calib.trace.conditioning import Conditioned, condition
from calib.trace.cuts import WHOLE, find_cuts, single_cut
from calib.trace.trace import Trace, read_trace
from tests.calib.made_cuts import LEVEL, NOISE, Cut, made_cut, plain_rows, text_of

CUT = made_cut()
TRUE = condition(CUT.trace())


def written(folder: Path, cut: Cut, keep: np.ndarray | None = None) -> Trace:
    """The cut through a file, whose rows begin at 2; only some of its samples."""
    rows = plain_rows(cut)
    path = folder / "cut.csv"
    path.write_text(
        text_of(
            "time_s,force_N,position_m", rows if keep is None else [r for r, k in zip(rows, keep, strict=True) if k]
        )
    )
    return read_trace(path)


def at(*seconds: float) -> np.ndarray:
    """Whether each sample lies between two times [s]."""
    return (CUT.time >= seconds[0] - 1e-9) & (CUT.time <= seconds[1] + 1e-9)


def as_before(done: Conditioned) -> None:
    """Contact, level and peak are those of the sound record."""
    assert done.onset_s == pytest.approx(TRUE.onset_s, abs=0.01)
    assert done.peak_N == pytest.approx(TRUE.peak_N, rel=0.005)


def noted(done: Conditioned, words: str) -> None:
    """One of the warnings says this."""
    assert any(re.search(words, note) for note in done.warnings), done.warnings


@pytest.mark.parametrize("value", [9999.0, -9999.0, 0.0, 40.0, 1e5])
@pytest.mark.parametrize(("time", "row"), [(0.755, 153), (1.8, 362)])
def test_a_value_that_stands_out_alone_is_replaced(tmp_path: Path, value: float, time: float, row: int) -> None:
    """A code of an error, a lost sample, a disturbance, before contact and in the cut."""
    done = condition(written(tmp_path, CUT.but(force=np.where(np.abs(CUT.time - time) < 1e-6, value, CUT.force))))
    as_before(done)
    noted(done, rf"cut.csv, row {row} \({time:.4g} s\), column force_N: {re.escape(f'{value:.4g}')} N stands out alone")


def test_two_lost_samples_on_end_are_one_fault(tmp_path: Path) -> None:
    """The note says that there is another after the first."""
    done = condition(written(tmp_path, CUT.but(force=np.where(at(1.8, 1.805), 0.0, CUT.force))))
    as_before(done)
    noted(done, r"row 362 .* and 1 after it, stands out")


def test_many_values_that_stand_out_are_refused(tmp_path: Path) -> None:
    """A loose cable is not repaired: the first row and their number are named."""
    lost = np.random.default_rng(3).random(640) < 0.03
    with pytest.raises(
        TraceError, match=r"row \d+ .*stands out alone from its neighbours, and so do \d+ other samples"
    ):
        condition(written(tmp_path, CUT.but(force=np.where(lost, 500.0, CUT.force))))


def test_a_sensor_zeroed_before_contact(tmp_path: Path) -> None:
    """The level goes to zero in one sample; the contact stays, and the level is open by the noise of both sides."""
    force = np.where(CUT.time < 0.7, CUT.force, CUT.force - LEVEL)
    done = condition(written(tmp_path, CUT.but(force=force)))
    as_before(done)
    noted(done, r"row 142 \(0.7 s\), column force_N: the level goes from 3.* to .* N in one sample")
    assert done.baseline_sd_N > TRUE.baseline_sd_N


def test_contact_is_no_zeroing() -> None:
    """A stiff food met between two samples, a step to a plateau that falls to nothing later, is left as it is."""
    load = np.where((CUT.time > 1.0) & (CUT.time < 2.0), 10.0, 0.0) + np.where(CUT.time >= 2.0, 12.0, 0.0)
    noise = CUT.force - made_cut(peak=0.0).force + made_cut(peak=0.0).force - LEVEL
    cut = CUT.but(force=load + NOISE * np.random.default_rng(1).normal(size=640) + 0.0 * noise)
    assert condition(cut.trace()).peak_N == pytest.approx(12.0, rel=0.02)


@pytest.mark.parametrize(
    ("start", "stop", "says"),
    [
        (
            1.85,
            2.25,
            r"row 3\d\d \(.* s\) to row 3\d\d \(.* s\): no samples were written for 0.4\d* s.*force may reach",
        ),
        (0.95, 1.3, r"no samples were written for 0.3\d* s, and contact is there"),
    ],
)
def test_missing_samples_that_hide_peak_or_contact_are_refused(
    tmp_path: Path, start: float, stop: float, says: str
) -> None:
    """Rows, times and the force that may be hidden are named."""
    with pytest.raises(TraceError, match=says):
        condition(written(tmp_path, CUT, ~at(start, stop)))


@pytest.mark.parametrize(("start", "stop"), [(0.3, 0.5), (1.3, 1.4), (2.3, 2.4)])
def test_missing_samples_elsewhere_are_bridged(tmp_path: Path, start: float, stop: float) -> None:
    """Before contact and on a slope the peak is known; the gap is said."""
    done = condition(written(tmp_path, CUT, ~at(start, stop)))
    as_before(done)
    noted(done, r"row \d+ \(.* s\) to row \d+ \(.* s\): no samples were written for 0\.\d+ s")


@pytest.mark.parametrize("shift", [None, -5.0, 4.0])
def test_a_level_that_moves_within_the_cut_is_refused(tmp_path: Path, shift: float | None) -> None:
    """A sensor that is zeroed under load, or knocked, shows it behind the cut, or by a zero that was not its level."""
    moved = CUT.force - CUT.force[300] if shift is None else CUT.force + shift
    force = np.where(np.arange(640) < 300, CUT.force, moved)
    with pytest.raises(
        TraceError, match=r"row 302 \(1.5 s\), column force_N: the force changes by .* N from one sample"
    ):
        condition(written(tmp_path, CUT.but(force=force)))
    if shift is None:  # also where the record ends under load
        with pytest.raises(TraceError, match="the sensor was zeroed or moved there"):
            condition(written(tmp_path, CUT.but(force=force), CUT.time <= 2.59))


def test_food_that_breaks_is_only_said() -> None:
    """A fall within one sample, after which the force goes on and the level behind the cut is the old one."""
    inside = (CUT.time > 1.6) & (CUT.time < 2.6)
    done = condition(CUT.but(force=CUT.force - 3.0 * inside).trace())
    noted(
        done,
        r"sample 321 \(1.605 s\), column force_N: the force changes by -3.* N from one sample .*: food that breaks",
    )


@pytest.mark.parametrize("value", [0.0, 9.0, -1.0])
def test_a_position_that_stands_out_alone_is_replaced(tmp_path: Path, value: float) -> None:
    """A lost sample of the robot's state would be the lowest point of the way otherwise."""
    done = condition(written(tmp_path, CUT.but(height=np.where(np.arange(640) == 250, value, CUT.height))))
    as_before(done)
    assert done.stroke_length_m == pytest.approx(TRUE.stroke_length_m, abs=1e-4)
    noted(done, rf"row 252 \(1.25 s\), column position_m: {value:g} m stands out alone")


def test_a_sensor_that_falls_out_shows_nothing_of_the_force(tmp_path: Path) -> None:
    """Zeros on end are no measurements, the first of them neither."""
    done = condition(written(tmp_path, CUT.but(force=np.where(at(1.3, 1.4), 0.0, CUT.force))))
    as_before(done)
    noted(done, r"row 261 .* to row 283 .*: the force is frozen")
    with pytest.raises(TraceError, match=r"row 361 .*the force is frozen for .* and the force may reach"):
        condition(written(tmp_path, CUT.but(force=np.where(at(1.8, 2.25), 0.0, CUT.force))))


def test_a_clock_that_jumps_ahead_without_a_position_is_refused() -> None:
    """At a constant speed the time that was not would be a way that was not."""
    time = np.where(CUT.time > 1.5, CUT.time + 3.0, CUT.time)
    with pytest.raises(
        TraceError, match="no samples were written for 3 s.* mm of the cut, unless the clock has jumped"
    ):
        condition(Trace(time, CUT.force, None, "made.csv", "", {"force": "force_N"}), speed=0.02)


def test_a_clipped_force_is_refused(tmp_path: Path) -> None:
    """The largest values are one constant: so is the peak's lower bound, and no more is known."""
    for limit in (9.0, 13.0):
        with pytest.raises(
            TraceError, match=rf"row \d+ .* to row \d+ .*, column force_N: the force is {limit:g} N in all"
        ):
            condition(written(tmp_path, CUT.but(force=np.minimum(CUT.force, limit))))
    flicker = np.minimum(CUT.force, 9.0) + 0.0005 * np.random.default_rng(1).integers(0, 2, 640)
    with pytest.raises(TraceError, match="the sensor is clipped there"):
        condition(written(tmp_path, CUT.but(force=flicker)))
    before = condition(written(tmp_path, CUT.but(force=np.minimum(CUT.force, 9.0))), t_end=1.5)
    assert before.peak_N < 6.5


def test_a_plateau_without_noise_is_only_said() -> None:
    """A drawn curve has no noise that would tell a plateau from a sensor at its end."""
    load = np.clip((CUT.time - 1.0) * 20.0, 0.0, 10.0)
    done = condition(replace(CUT.trace(), force=load))
    noted(done, "a plateau without noise, or a sensor at the end of its range")


def test_a_frozen_sensor(tmp_path: Path) -> None:
    """Held values are no measurements: at the peak they are refused, on a slope they are bridged."""
    held = np.where(at(1.3, 1.4), CUT.force[260], CUT.force)
    done = condition(written(tmp_path, CUT.but(force=held)))
    as_before(done)
    noted(done, r"row 262 .*: the force is frozen for 0.1\d* s")
    with pytest.raises(
        TraceError, match=r"row \d+ .*: the force is frozen for .* s.*force may reach|sensor is clipped"
    ):
        condition(written(tmp_path, CUT.but(force=np.where(at(1.8, 2.5), CUT.force[360], CUT.force))))


@pytest.mark.parametrize("jump", [5.0, -0.6])
def test_a_clock_that_jumps_while_the_knife_goes_on(tmp_path: Path, jump: float) -> None:
    """The position shows that no time has passed: the jump is taken out."""
    moved = CUT.but(time=np.where(CUT.time > 1.4, CUT.time + jump, CUT.time))
    done = condition(written(tmp_path, moved))
    as_before(done)
    noted(done, rf"row 283, column time_s: the clock jumps {'ahead' if jump > 0 else 'back'} by {abs(jump):g}")
    assert done.onset_sd_s > TRUE.onset_sd_s


def test_a_clock_that_jumps_back_without_a_position_is_refused(tmp_path: Path) -> None:
    """Nothing tells how much time has passed."""
    path = tmp_path / "cut.csv"
    time = np.where(CUT.time > 1.4, CUT.time - 0.6, CUT.time)
    path.write_text(text_of("time_s,force_N", [(f"{t:.4f}", f"{f:.4f}") for t, f in zip(time, CUT.force, strict=True)]))
    with pytest.raises(TraceError, match="row 283, column time_s: time does not increase"):
        read_trace(path)


def test_rows_that_are_written_twice(tmp_path: Path) -> None:
    """They are left out and said."""
    rows = plain_rows(CUT)
    path = tmp_path / "cut.csv"
    path.write_text(text_of("time_s,force_N,position_m", [*rows[:100], rows[99], *rows[100:]]))
    done = condition(read_trace(path))
    as_before(done)
    noted(done, "1 rows that repeat the row before them were left out, the first is row 102")


def test_coarse_steps_grow_the_uncertainty() -> None:
    """A force that counts in half newtons is said to, and its peak is open by their twelfth root."""
    done = condition(replace(CUT.trace(), force=np.round(CUT.force * 2.0) / 2.0))
    noted(done, r"the force counts in steps of 0\.5 N")
    assert done.peak_sd_N >= 0.5 / 12**0.5
    assert done.peak_N == pytest.approx(TRUE.peak_N, abs=0.5)


def test_a_board_at_the_end_is_said() -> None:
    """A force that rises steeply over the last millimetres may be the board's; as stiff as an arm on it, it is, and the
    cut ends there."""
    depth = 0.02 * (CUT.time - 1.0)

    def hit(at: float, stiffness: float) -> Conditioned:
        """The cut with a board at a depth [m], as stiff as that [N/m]."""
        on = np.where((depth > at) & (CUT.time <= 2.6), stiffness * (depth - at), 0.0)
        return condition(CUT.but(force=CUT.force + on).trace())

    soft = hit(0.0305, 2.6e3)
    noted(soft, "the edge may be on the board; end the cut before it")
    assert not soft.at_board and soft.stroke_length_m == pytest.approx(TRUE.stroke_length_m, abs=1e-5)
    hard = hit(0.0312, 55e3)
    noted(hard, "the force shoots up at 3[01]\\.[0-9] mm of the stroke of 32.0 mm, as on a board: the edge is on it")
    assert hard.at_board and hard.stroke_length_m == pytest.approx(0.0312, abs=4e-4)
    assert not any("may be on the board" in note for note in hard.warnings)
    assert hard.peak_N == pytest.approx(TRUE.peak_N, rel=0.01)
    assert not any("board" in note for note in TRUE.warnings) and not TRUE.at_board


def drifting(cut: Cut = CUT, rate: float = 0.8) -> Trace:
    """The cut with a drift [N/s]."""
    return replace(cut.trace(), force=cut.force + rate * cut.time)


def test_a_drift_is_removed_on_request() -> None:
    """With the knife raised again the drift is known on both sides; without, its doubt over the cut enters the peak."""
    constant, both = condition(drifting()), condition(drifting(), baseline="linear")
    assert constant.peak_N - TRUE.peak_N > 0.5
    as_before(both)
    noted(both, r"a drift of 0\.(79|80?)\d* \+- .* N/s was removed, measured before contact and after the cut")
    down = CUT.time <= 2.595
    ends = Trace(CUT.time[down], drifting().force[down], CUT.height[down], "made.csv", "", {"force": "force_N"})
    ahead = condition(ends, baseline="linear")
    noted(ahead, "measured before contact, and carried on over the cut")
    assert abs(ahead.peak_N - TRUE.peak_N) < 3.0 * ahead.peak_sd_N and ahead.peak_sd_N > TRUE.peak_sd_N
    drift = next(n for n in nuisances(ahead, sensor_of(ahead, 0.0, None)[0]) if n.name == "drift")
    assert drift.sd == pytest.approx(ahead.drift_sd_N_per_s * (ahead.end_s - ahead.onset_s), rel=1e-9)
    with pytest.raises(TraceError, match="--baseline linear beside --air"):
        condition(drifting(), air=CUT.trace(), baseline="linear")
    with pytest.raises(TraceError, match="'square' is not one of constant, linear, zero"):
        condition(drifting(), baseline="square")


def test_a_record_that_starts_at_its_trigger() -> None:
    """Without an approach it is refused, with the remedy; with the machine's zero the trigger's force is its doubt."""
    after = CUT.time >= 1.02
    trace = Trace(CUT.time[after], CUT.force[after] - LEVEL, CUT.height[after], "made.csv", "", {"force": "force_N"})
    with pytest.raises(TraceError, match="keep the approach.*--baseline zero"):
        condition(trace)
    done = condition(trace, baseline="zero")
    assert done.onset_s == trace.time[0] and done.peak_N == pytest.approx(TRUE.peak_N, rel=0.01)
    assert done.baseline_sd_N >= 0.05
    with pytest.raises(TraceError, match="the machine was not zeroed"):
        condition(replace(trace, force=trace.force + 8.0), baseline="zero")


def several(peaks: tuple[float, ...], *, position: bool) -> Trace:
    """Cuts on end."""
    parts = [made_cut(peak=p, seed=k) for k, p in enumerate(peaks)]
    time = np.arange(640 * len(parts)) / 200.0
    height = np.concatenate([part.height for part in parts]) if position else None
    return Trace(time, np.concatenate([p.force for p in parts]), height, "made.csv", "", {"force": "force_N"})


@pytest.mark.parametrize("position", [True, False])
def test_several_cuts_are_counted_and_chosen(position: bool) -> None:
    """None is joined to another: without a choice the record is refused, and each choice gives its own peak."""
    peaks = (12.0, 10.0, 14.0)
    trace = several(peaks, position=position)
    with pytest.raises(
        TraceError, match=r"the record holds 3 cuts, .*sample \d+ \(1\.\d* s\).*--cut 1 to --cut 3.*--all"
    ):
        condition(trace, speed=0.02)
    for k, peak in enumerate(peaks, start=1):
        alone = condition(made_cut(peak=peak, seed=k - 1).trace())
        done = condition(single_cut(trace, k), speed=0.02)
        assert done.peak_N == pytest.approx(alone.peak_N, rel=0.02)
        noted(done, f"cut {k} of 3, from ")
    with pytest.raises(TraceError, match="there is no cut 4, the record holds 3"):
        single_cut(trace, 4)
    assert len(find_cuts(CUT.trace())) == 1
    assert single_cut(trace, WHOLE).whole and single_cut(CUT.trace(), 1).time.shape == CUT.time.shape


def test_a_clock_that_starts_again_begins_another_cut(tmp_path: Path) -> None:
    """Two records in one file, with the header again or not, are two cuts."""
    first, second = plain_rows(CUT), plain_rows(made_cut(peak=8.0, seed=1))
    header = "time_s,force_N,position_m"
    for text in (text_of(header, [*first, *second]), text_of(header, first) + "\n" + text_of(header, second)):
        path = tmp_path / "cut.csv"
        path.write_text(text)
        trace = read_trace(path)
        assert len(find_cuts(trace)) == 2 and any("begins anew at row" in note for note in trace.notes)
        assert condition(single_cut(trace, 2)).peak_N == pytest.approx(TRUE.peak_N * 8.0 / 12.0, rel=0.02)


FAULTLESS: tuple[Callable[[np.random.Generator], Cut], ...] = (
    lambda rng: made_cut(seed=int(rng.integers(1000))),
    lambda rng: made_cut(peak=float(rng.uniform(2.0, 25.0)), level=float(rng.uniform(-5.0, 5.0))),
    lambda rng: made_cut(peak=3.0, seed=int(rng.integers(1000))),
)


@pytest.mark.parametrize("make", FAULTLESS)
def test_sound_records_are_left_alone(make: Callable[[np.random.Generator], Cut]) -> None:
    """No fault is found where there is none."""
    rng = np.random.default_rng(5)
    for _ in range(8):
        assert condition(make(rng).trace()).warnings == ()
