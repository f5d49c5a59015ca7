"""One place where Taichi is started; a process has one Taichi runtime at a time."""

from __future__ import annotations

import contextlib
import io
import os
from dataclasses import dataclass, replace
from typing import Any

from mpm.runtime.compiler import quicken_front_end
from mpm.scene.errors import SceneError

ARCHES = ("cpu", "cuda", "vulkan", "gpu")
"""Devices; not Metal, which has no doubles: the way of the blade needs them."""
SINGLE = ("vulkan",)
"""Devices whose kernels are in single precision, whatever a scene asks for: Taichi has no exponential of doubles for
them, and its additions to a double are no atomic ones there, so that impulses are lost."""

CACHE_SIZE = 1 << 29
"""Machine code that is kept for later processes at most [bytes]: some 400 kernels of a time step. Beyond it Taichi
drops a quarter. Its own limit, 100 MiB, holds fewer than the tests have, so that they compiled many of them again."""


@dataclass(frozen=True)
class Runtime:
    """Device on which kernels run. Attributes: arch; threads (0 = all cores)."""

    arch: str = "cpu"
    threads: int = 0

    def __post_init__(self) -> None:
        if self.arch not in ARCHES:
            raise SceneError(f"arch: {self.arch!r} is not one of {', '.join(ARCHES)}")

    @property
    def cpu_threads(self) -> int:
        """Threads that a CPU kernel uses."""
        return self.threads or os.cpu_count() or 1


_state: dict[str, Any] = {"key": None, "serial": 0}


def start(runtime: Runtime, precision: str) -> int:
    """Start Taichi for this device and precision, or keep the one that runs.

    Returns:
        Serial number of the runtime: fields made under another number no longer exist.

    Raises:
        SceneError: The device is not available, or cannot do what a cut needs.
    """
    import taichi as ti

    quicken_front_end()
    key = (runtime, precision)
    if _state["key"] == key:
        return _state["serial"]
    arch = getattr(ti, runtime.arch)
    real = ti.f64 if precision == "f64" and runtime.arch not in SINGLE else ti.f32
    _state["key"] = None
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            ti.init(
                arch=arch,
                default_fp=real,
                cpu_max_num_threads=runtime.cpu_threads,
                offline_cache=True,
                offline_cache_max_size_of_files=CACHE_SIZE,
                # LLVM does the same work again (docs/theory.md, "Measured choices")
                advanced_optimization=runtime.arch != "cpu",
                log_level=ti.ERROR,
                random_seed=0,
                enable_fallback=False,
            )
    except RuntimeError:  # Taichi: "Arch=... is not supported"
        if runtime.arch == "cpu":
            raise
        raise _missing(runtime.arch) from None
    found = ti.lang.impl.current_cfg().arch
    if runtime.arch != "cpu" and found == ti.cpu:
        raise _missing(runtime.arch)
    if found == ti.metal:
        raise SceneError("arch: the GPU here is Metal's, which has no double precision; use --arch cpu")
    if runtime.arch == "gpu" and found == ti.vulkan:
        serial = start(replace(runtime, arch="vulkan"), precision)
        _state["key"] = key  # asked for again, it keeps running
        return serial
    _state["key"] = key
    _state["serial"] += 1
    return _state["serial"]


def stop() -> None:
    """End the runtime, if there is one. Only then Taichi puts what it has compiled into the cache of all processes."""
    if _state["key"] is not None:
        import taichi as ti

        _state["key"] = None
        ti.reset()


def running() -> int:
    """Serial number of the runtime that was started last, 0 before the first."""
    serial: int = _state["serial"]
    return serial


def adds_doubles() -> bool:
    """Whether kernels of the device that was started may add to a double from many threads."""
    import taichi as ti

    return ti.lang.impl.current_cfg().arch in (ti.cpu, ti.cuda)


def _missing(arch: str) -> SceneError:
    return SceneError(f"arch: {arch} is not available on this machine; use --arch cpu")
