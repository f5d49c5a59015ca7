"""What cutcal needs of a machine, tried one by one: packages, the solver, devices, the cache, typesetting, disk."""

from __future__ import annotations

import json
import math
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from calib._version import __version__
from calib.material.food import load_foods
from calib.material.knife import load_knives
from cutcal.installation import overwritten
from mpm.scene import EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.errors import CutcalError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

FLESH = Material(E=1e6, nu=0.35, rho=1000, yield_stress=2e5, R=300.0, R_initiation=300.0)
BLADE = Knife("thin", 0.2e-3, math.radians(1.0), 0.05, 0.4)
CUT = Scene(
    Food(Shape("block", 0.024, 0.024, 0.024), FLESH),
    BLADE,
    Motion(0.014, 0.02),
    edge=EdgeLaw(zone=4e-3),
    numerics=Numerics(dx=4e-3),
)
"""A cut of a second: a thin blade without friction needs R times the width (Atkins 2009)."""
WANTED = FLESH.R * CUT.food.shape.width
CLOSE = 0.05
"""Error of that force that passes; on the few coarse cells it is 1 %."""
PATIENCE = 180.0
"""Seconds after which a device that has not answered is given up; compiling for the first time takes a twentieth."""
BUSY = 1.5
"""Processes that want a core, for each core, from which on a device that has not answered may only have waited."""
DEVICES = {"cuda": "CUDA", "vulkan": "Vulkan"}
EXTRAS = {
    "cluster": "--scheduler",
    "sample": "--sample",
    "view": "--video and --page",
    "data": "dataset export",
    "robot": "dataset generate",
}
"""What the optional packages are for."""
SMALL = 1.5e9
"""Free memory under which a calibration may not fit [byte].

A worker takes 0.2 GB (resident, of the small cut); there are two of them, the main process with its report, and other
programs."""


@dataclass(frozen=True)
class Finding:
    """One line of the examination.

    Attributes:
        name: What was tried.
        state: ``ok``; ``absent`` where cutcal works without it; ``fail``.
        words: What was found, and for a failure what to do.
    """

    name: str
    state: str
    words: str

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def examine(folder: Path) -> Iterator[Finding]:
    """Try everything, one finding after the other.

    Args:
        folder: Where results would be written.
    """
    yield Finding("cutcal", "ok", f"{__version__}, Python {platform.python_version()}, {platform.platform()}")
    yield packages()
    yield own_packages()
    yield _tried("foods and knives", _data, "install cutcal again")
    cpu, cache = device("cpu", "solver")
    yield cpu
    for arch, name in DEVICES.items():
        yield device(arch, name)[0]
    yield kernels(cache)
    yield _tried("report", _typeset, "pip install --force-reinstall typst matplotlib")
    yield pictures()
    yield robot()
    yield memory()
    yield writable("folder for results", folder)


def packages() -> Finding:
    """Whether the packages that cutcal asks for are installed; those of its extras may be absent."""
    try:
        asked = metadata.requires("cutcal") or []
    except metadata.PackageNotFoundError:
        return Finding("packages", "fail", "cutcal itself is not installed: pip install . in the checkout")
    needed, missing = 0, list[str]()
    without: dict[str, list[str]] = {}
    for line in asked:
        name, extra = str(re.match(r"[\w.-]+", line)[0]), re.search(r"extra == ['\"](\w+)", line)  # type: ignore[index]
        if extra is not None and extra[1] not in EXTRAS:
            continue
        here = _installed(name)
        if extra is None:
            needed += 1
            missing += [] if here else [name]
        elif not here:
            without.setdefault(extra[1], []).append(name)
    if missing:
        return Finding("packages", "fail", f"missing: pip install {' '.join(missing)}")
    each = [f"{', '.join(names)} for {EXTRAS[x]} (pip install 'cutcal[{x}]')" for x, names in without.items()]
    absent = f"; absent: {'; '.join(each)}" if each else ""
    return Finding("packages", "ok", f"all {needed} are installed{absent}")


def own_packages() -> Finding:
    """Whether no other distribution has overwritten one of cutcal's packages."""
    found = overwritten()
    return Finding("own packages", "fail" if found else "ok", found.sentence() if found else "none is overwritten")


def _installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def _tried(name: str, attempt: Callable[[], str], remedy: str) -> Finding:
    """A finding of something that says what it found, or fails."""
    try:
        return Finding(name, "ok", attempt())
    except (CutcalError, ImportError, OSError, RuntimeError, ValueError) as e:
        return Finding(name, "fail", f"{_last_line(str(e))}; {remedy}")


def _data() -> str:
    return f"{len(load_foods())} foods, {len(load_knives())} knives"


def _typeset() -> str:
    import typst

    from reports.base.figures import svg

    picture = svg(lambda figure: figure.add_subplot().plot([0.0, 1.0]), 40.0)
    size = len(typst.compile(b"= cutcal", format="pdf"))
    return f"a picture of {len(picture) / 1e3:.0f} kB was drawn and a page of {size / 1e3:.0f} kB typeset"


def pictures() -> Finding:
    """Whether a picture is drawn without a screen."""
    remedy = "everything else works; on Linux the package libegl1 or libosmesa6 is needed"
    return _optional("pictures of simulate", "from reports.base.scene_render import attempt; print(attempt())", remedy)


def robot() -> Finding:
    """Whether the robot simulator runs, and whether it renders by itself, which no picture of a dataset needs."""
    name = "robot simulator"
    if not _installed("mani_skill"):
        return Finding(
            name, "absent", "ManiSkill is not installed; everything else works (pip install 'cutcal[robot]')"
        )
    remedy = (
        "states, forces and pictures of the cameras work, ManiSkill's viewer and its depth pictures do not: SAPIEN "
        "needs Vulkan with descriptorBindingPartiallyBound. Mesa 25 "
        "has it (mesa-vulkan-drivers of Debian 13, or of Debian 12's backports), Debian 12's own 22.3 has not"
    )
    code = "import sapien; sapien.render.RenderMaterial(); print('ManiSkill is installed and SAPIEN renders')"
    return _optional(name, code, remedy)


def _optional(name: str, code: str, remedy: str) -> Finding:
    """What cutcal does without, tried in a process that may crash or hang."""
    command = [sys.executable, "-c", code]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return Finding(name, "absent", no_answer(remedy))
    if done.returncode != 0:
        why = _last_line(done.stderr) or f"its process ended with {done.returncode}"
        return Finding(name, "absent", f"{why}; {remedy}")
    return Finding(name, "ok", _last_line(done.stdout))


def device(arch: str, name: str) -> tuple[Finding, Path | None]:
    """A small cut on a device, in a process that may crash or hang; and the folder of the kernels' cache."""
    command = [sys.executable, "-m", "cutcal.doctor", arch]
    remedy = "pip install --force-reinstall taichi" if arch == "cpu" else "simulations run on the CPU"
    bad = "fail" if arch == "cpu" else "absent"
    began = time.monotonic()
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return Finding(name, bad, no_answer(remedy)), None
    whole = time.monotonic() - began
    try:
        found = json.loads(done.stdout.strip().splitlines()[-1])
    except (IndexError, ValueError):
        why = _last_line(done.stderr) or f"its process ended with {done.returncode}"
        why = "not on this machine" if "is not available" in why else why
        return Finding(name, bad, f"{why}; {remedy}"), None
    cache = Path(found["cache"]) if found["cache"] else None
    error = found["force_N"] / WANTED - 1
    words = (
        f"a small cut needs {found['force_N']:.3g} N where R times the width is {WANTED:.3g} N; {whole:.0f} s with "
        f"start and compilation, {found['seconds']:.1f} s without"
    )
    if not (abs(error) <= CLOSE and found["balance"] < 1e-3):
        return Finding(name, "fail", f"{words}: this device computes wrongly; do not use it"), cache
    return Finding(name, "ok", words), cache


def no_answer(remedy: str) -> str:
    """That a device was given up, and what to do: on a busy machine nothing but wait."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    said = f"no answer within {PATIENCE:g} s"
    if load < BUSY * _cores():
        return f"{said}; {remedy}"
    return (
        f"{said}, while {load:.0f} processes wanted {_cores()} cores; end other programs and try again, else {remedy}"
    )


def _cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ""


def kernels(cache: Path | None) -> Finding:
    """Whether compiled kernels are kept: without that every process compiles for some seconds."""
    name = "cache of kernels"
    if cache is None:
        return Finding(name, "absent", "not known: the solver did not run")
    if not cache.is_dir() or not os.access(cache, os.W_OK):
        return Finding(
            name,
            "absent",
            f"{cache} cannot be written, so every process compiles anew; set TI_OFFLINE_CACHE_FILE_PATH to a folder "
            "that can",
        )
    size = sum(f.stat().st_size for f in cache.rglob("*") if f.is_file())
    return Finding(name, "ok", f"{cache}, {size / 1e6:.0f} MB")


def _free_memory() -> float:
    """Memory that a program can have [B]: what holds copies of files is given back when it is asked for.

    Raises:
        AttributeError, ValueError, OSError: The system does not say.
    """
    try:
        said = re.search(r"^MemAvailable:\s+(\d+) kB", Path("/proc/meminfo").read_text("ascii"), re.MULTILINE)
    except OSError:  # not Linux
        said = None
    if said:
        return 1024.0 * int(said[1])
    return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))


def memory() -> Finding:
    """Cores and free memory."""
    cores = _cores()
    words = f"{cores} core{'s' if cores > 1 else ''}"
    try:
        free = _free_memory()
    except (AttributeError, ValueError, OSError):  # not on macOS and Windows
        return Finding("cores and memory", "ok", words)
    words += f", {free / 1e9:.1f} GB free"
    if free < SMALL:
        return Finding("cores and memory", "fail", f"{words}; use --workers 1, or end other programs")
    return Finding("cores and memory", "ok", words)


def writable(name: str, folder: Path) -> Finding:
    """Whether a file can be written into a folder."""
    try:
        with tempfile.NamedTemporaryFile(dir=folder):
            return Finding(name, "ok", f"{folder.resolve()} can be written")
    except OSError as e:
        return Finding(name, "fail", f"{folder.resolve()}: {e.strerror}; give another --out")


def _cut(arch: str) -> dict[str, Any]:
    """The small cut twice, the second time compiled."""
    import taichi as ti

    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    simulation = Simulation(CUT, Runtime(arch, 1))
    simulation.run()
    record = simulation.run()
    on = (record.stroke > 8e-3) & (record.stroke < 13e-3)
    return {
        "force_N": float(record.resolved[on].mean()) if record.status == "done" else 0.0,
        "balance": record.momentum_residual,
        "seconds": record.wall,
        "cache": str(ti.lang.impl.current_cfg().offline_cache_file_path),
    }


if __name__ == "__main__":
    try:
        sys.stdout.write(json.dumps(_cut(sys.argv[1])))
    except CutcalError as error:
        sys.exit(str(error))
