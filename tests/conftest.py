"""Fixtures of all tests."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: more threads only make the tests slower

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def _seed() -> None:
    """Start every test from the same global random state, whatever ran before it."""
    random.seed(0)
    np.random.seed(0)


@pytest.fixture(autouse=True, scope="session")
def _no_waiting_for_disks() -> Iterator[None]:
    """What is written is not waited for to be on the disk: thousands of times some milliseconds, and no test cuts the
    power."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda file: None)
        yield


@pytest.fixture(autouse=True, scope="session")
def _kept_states() -> Iterator[None]:
    """Keep the fields of more scenes than a process of its own does, and give them more room: tests take turns with
    some dozen sizes of them, and kernels are compiled anew, for many seconds, for each size and where fields are made
    again."""
    import mpm.solver
    from mpm.discretisation import capacity

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mpm.solver, "KEPT", 12)
        patch.setattr(capacity, "NODE_ROOM", (48, *capacity.NODE_ROOM[1:]))
        patch.setattr(capacity, "PARTICLE_ROOM", (16_384, *capacity.PARTICLE_ROOM[1:]))
        yield
