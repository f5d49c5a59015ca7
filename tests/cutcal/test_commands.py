"""The command line for whoever types it: help of one screen, examples that parse, one line for each slip, nothing
beside JSON."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys

import pytest

from calib._version import __version__
from calib.material.food import load_foods
from calib.material.knife import load_knives
from cutcal.doctor import Finding
from cutcal.main import COMMANDS, EPILOG, calibrate, command, main, parser
from cutcal.parsing import commands, parse
from tests.calib.documents import valid
from tests.cutcal.test_cli import BANANA, ROOT

LINES, COLUMNS = 50, 80
"""What a terminal window shows at once; a command that needs more has too many options."""


def examples(text: str) -> list[list[str]]:
    """Command lines in the text below a help, without the name of the program."""
    lines = text.replace("\\\n", " ").splitlines()
    typed = [shlex.split(line) for line in lines if line.startswith(("  cutcal ", "  calibrate "))]
    return [words if words[0] == "calibrate" else words[1:] for words in typed]


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help_fits_a_screen(command, capsys, monkeypatch):
    """80 columns and 50 lines, with an example, and without a code of colour."""
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    with pytest.raises(SystemExit) as stop:
        main([*command.split(), "--help"])
    text = capsys.readouterr().out
    assert stop.value.code == 0 and "\x1b" not in text
    assert [line for line in text.splitlines() if len(line) > COLUMNS] == []
    assert len(text.splitlines()) <= LINES
    assert "example" in text


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_examples_parse(name):
    """Every example in a help is one that the parser takes, of this very command."""
    found = examples(command(name).EPILOG if name else EPILOG)
    assert found
    for words in found:
        args = parse(parser(), words)
        assert args.command == (name or "calibrate")


def test_every_option_is_explained_with_what_it_takes():
    """No option is without an explanation, and none leaves the name of its value to chance, its own in capitals."""
    for name, one in commands(parser()).items():
        for action in one._actions:
            assert action.help, (name, action.dest)
            if action.option_strings and action.nargs != 0:
                assert action.metavar, (name, action.dest)


@pytest.mark.parametrize("text", ["0.045", "45mm", "4.5 cm", "45000um", " 4.5e1mm "])
def test_a_length_may_have_its_unit(text):
    """Metres, or a number and its unit, on every option that takes a length, and in a list of them."""
    args = parse(parser(), ["simulate", "--food", "banana", "--height", text])
    assert args.height == 0.045
    assert parse(parser(), ["converge", "--food", "banana", "--dx", "3mm,0.002"]).dx == (0.003, 0.002)


def test_every_option_in_metres_takes_millimetres():
    """Whatever is called M in a help takes 2mm for two thousandths: none is left that reads plain numbers alone."""
    seen = set()
    for name, one in commands(parser()).items():
        for action in one._actions:
            if action.metavar and action.metavar.split(",")[0] == "M":
                assert action.type is not None, (name, action.dest)
                found = action.type("2mm")
                assert found in (0.002, (0.002,)), (name, action.dest)
                seen.add(action.dest)
    assert {"height", "width", "length", "diameter", "dx", "stroke", "retract", "zone", "board_z", "sigma"} <= seen


@pytest.mark.parametrize(
    ("typed", "dest", "value"),
    [
        ("--board-z -4mm", "board_z", -0.004),
        ("--board-z -4e-3", "board_z", -0.004),
        ("--speed 20mm/s", "speed", 0.02),
        ("--lag-sd 5ms", "lag_sd", 0.005),
        ("--rate 1kHz", "rate", 1000.0),
        ("--t-end 1.7e9", "t_end", 1.7e9),
        ("--at 30%", "at", 0.3),
        ("--set E=0.3MPa", "set", ["E=0.3MPa"]),
    ],
)
def test_other_quantities_may_have_their_units_too(typed, dest, value):
    """Speeds, times, frequencies and parts as well; a negative number with a unit is a value, and no option."""
    args = parse(parser(), ["calibrate", "--food", "banana", "--trace", "x.csv", *typed.split()])
    assert getattr(args, dest) == value


SLIPS = {
    "": ["name a command", "cutcal --help"],
    "calibrat": ["no command 'calibrat'", "did you mean 'calibrate'?"],
    "help": ["no command 'help'", "calibrate"],
    "--verison": ["--verison", "did you mean --version?"],
    "simulate": ["--food", "required"],
    "simulate --fod banana": ["--fod", "did you mean --food?"],
    "simulate --food": ["--food", "expected one argument"],
    "simulate --food Bananna": ["did you mean 'banana'?"],
    "simulate --food banana --knife kichen": ["did you mean 'kitchen'?"],
    "simulate --food banana --height 30furlong": ["--height", "'30furlong' is not a length: write it in m", "mm, cm"],
    "simulate --food banana --height 3000mm": ["--height", "3000mm must be more than 0.001 and less than 1 m"],
    "simulate --food banana --height 30": ["--height", "30", "0.001 and less than 1 m"],
    "simulate --food banana --shape sylinder": ["--shape", "did you mean 'cylinder'?"],
    "simulate --food banana --trace x.csv": ["--trace", "calibrate", "predict", "have it"],
    "simulate --food banana --seed -1": ["--seed", "at least 0"],
    "simulate --food banana --seed x": ["--seed", "'x' is not a whole number"],
    "simulate --food banana --set E=200mm": ["E: '200mm' is not a stress", "in Pa", "kPa", "Young's modulus"],
    "simulate --food banana --speed 20kg": ["--speed", "'20kg' is not a speed: write it in m/s", "mm/s"],
    "simulate --food banana --at 20mm": ["--at", "'20mm' is not a part", "0.3", "%"],
    "simulate --food banana --constant zone=2px": ["--constant zone=2px", "'2px' is not a length"],
    "calibrate --food banana --trace x.csv --board-z nan": ["--board-z", "nan is not a finite number"],
    "foods banan": ["did you mean 'banana'?"],
    "foods banana apple": ["apple is too much", "cutcal foods --help"],
    "knives ed": ["did you mean 'edc'?"],
    "knives nowhere.yaml": ["nowhere.yaml", "no such file", "check the path"],
    "calibrate banana cut.csv": ["banana cut.csv is too much", "option"],
    "calibrate --food banana --trace nowhere.csv": ["nowhere.csv: no such file", "check the path"],
    "calibrate --food banana --trace {folder}": ["is a directory", "CSV, JSON or HDF5"],
    "calibrate --food banana --trace {banana} --fit E,yeild": ["'yeild'", "did you mean 'yield_stress'?"],
    "calibrate --food banana --trace {banana} --fit ,": ["--fit", "no property", "E,R"],
    "calibrate --food banana --trace {banana} --set nu=0.6": ["nu: 0.6 cannot be", "between -0.999 and 0.49:"],
    "calibrate --food banana --trace {banana} --sign x": ["--sign", "'x'", "+, -"],
    "calibrate --food banana --trace {banana} --budget 1e9": ["--budget", "more than 0 and less than 1e+06;"],
    "calibrate --food banana --trace {banana} --force-col Force": ["'Force'", "did you mean 'force_N'?"],
    "calibrate --food banana --trace {banana} --material {folder}": ["cannot be read", "readable YAML file"],
    "calibrate --config {folder}": ["cannot be read", "readable YAML file"],
    "converge --food banana --dx 3e-3,x": ["--dx", "'x' is not a length"],
    "converge --food banana --repeats -1": ["--repeats", "at least 0"],
    "prior --draws 0": ["--draws", "at least 1"],
    "report nowhere": ["nowhere", "no such folder", "output folder of a calibration"],
    "stress --food banana": ["--food", "calibrate", "have it"],
    "schema calibrat": ["did you mean 'calibrate'?"],
    "completion powershel": ["no shell 'powershel'", "bash, zsh"],
}


@pytest.mark.parametrize("typed", SLIPS)
def test_a_slip_is_one_line_that_helps(typed, tmp_path, capsys, monkeypatch):
    """Whatever is typed wrong ends with exit code 1 (2 is for what ran) and one line that names it and what to do."""
    words = [w.format(folder=tmp_path, banana=BANANA) for w in shlex.split(typed)]
    monkeypatch.chdir(tmp_path)
    code = main(words)
    said = capsys.readouterr()
    lines = [line for line in said.err.splitlines() if not line.startswith("note:")]
    assert (code, said.out, len(lines)) == (1, "", 1)
    assert [word for word in SLIPS[typed] if word not in lines[0]] == []
    assert list(tmp_path.iterdir()) == []


def started(*words: str, **env: str) -> subprocess.Popen[bytes]:
    """The command in a process of its own, its output in pipes."""
    command = [sys.executable, "-m", "cutcal.main", *words]
    env = os.environ | {"PYTHONPATH": str(ROOT), **env}
    pipes = {
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "pipesize": 4096,
    }  # where it can be set, they hold little
    return subprocess.Popen(command, cwd=ROOT, env=env, **pipes)


def test_letters_that_a_pipe_has_not():
    """A pipe of plain ASCII gets a question mark for a degree sign, and JSON with every letter in it."""
    out, err = started("knives", "edc", PYTHONIOENCODING="ascii").communicate()
    assert out.startswith(b"edc: a wedge of 11? up to") and err == b""
    out, err = started("foods", "cherry", "--json", PYTHONIOENCODING="ascii").communicate()
    assert json.loads(out.decode("ascii"))["cherry"] == load_foods()["cherry"].as_dict() and err == b""


# Windows has no SIGPIPE: a write to a closed pipe is OSError with EINVAL there, and 141 no exit code of its shells.
@pytest.mark.skipif(sys.platform == "win32", reason="a pipe that was closed is another error on Windows")
def test_a_reader_that_has_enough_is_no_error():
    """``cutcal ... | head`` ends without a word."""
    process = started("completion", "bash")  # more than a pipe holds, so it must wait for the reader
    assert process.stdout is not None and process.stderr is not None
    process.stdout.read(10)
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait() == 141


def test_doctor_speaks_json_alone(monkeypatch, capsys):
    """What it finds goes into the document, and nothing is on standard output before or after."""
    finding = Finding("solver", "ok", "as fast as ever")
    monkeypatch.setattr("cutcal.commands.catalogue.doctor.examine", lambda folder: iter([finding]))
    assert main(["doctor", "--json"]) == 0
    assert valid(json.loads(capsys.readouterr().out))["findings"] == [finding.as_dict()]


def test_calibrate_alone_is_the_same(capsys, monkeypatch):
    """The short name is the same command."""
    monkeypatch.setattr(sys, "argv", ["calibrate", "--food"])
    assert calibrate() == main(["calibrate", "--food"]) == 1
    one, other = capsys.readouterr().err.splitlines()
    assert one == other
    monkeypatch.setattr(sys, "argv", ["calibrate", "--version"])
    with pytest.raises(SystemExit, match="0"):
        calibrate()
    assert capsys.readouterr().out == f"cutcal {__version__}\n"


def test_names_that_are_offered_are_known(capsys):
    """The script of each shell has all foods and knives in it."""
    for shell in ("bash", "zsh", "fish", "tcsh"):
        assert main(["completion", shell]) == 0
        text = capsys.readouterr().out
        assert all(food in text for food in load_foods())
        assert all(knife in text for knife in load_knives()) or shell == "tcsh"  # which has files there
        assert "calibrate" in text
