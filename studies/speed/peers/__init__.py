"""The standing block in other simulators, each through its own package and in an interpreter of its own.

Their packages want other versions of what this one needs, so they live in an environment of their own:

    python3 -m venv peers && peers/bin/pip install warp-lang torch genesis-world newton numpy
    cutcal bench --peers peers/bin/python --out runs/bench
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

LONG_STEPS = 10
PEERS: dict[str, tuple[str, int]] = {
    "Warp": ("warp_block.py", 1),
    "Genesis": ("genesis_block.py", 1),
    f"Newton, implicit, steps {LONG_STEPS} times as long": ("newton_block.py", LONG_STEPS),
}
"""Script of each peer, and its time step over the common one. With the common step Newton would take a quarter of an
hour on two cores."""
DEVICES = ("cpu", "cuda")
"""Devices that all peers have."""
PATIENCE = 900.0  # a peer that has not ended by then is given up [s]; compiling takes them up to a minute


def measure(python: str, name: str, block: dict[str, Any], threads: int) -> dict[str, Any]:
    """Time of a step of the standing block in a peer, and how the block moved.

    Args:
        python: Interpreter that has the peer's package.
        name: Peer, a key of PEERS.
        block: ``device``, ``dx`` [m], ``nodes`` (3), ``low`` corner (3) [m], ``counts`` of particles (3), ``dt`` [s],
            ``rho`` [kg/m^3], ``E`` [Pa], ``gravity`` [m/s^2], ``floor`` (node), ``steps`` in a window, ``windows``.
        threads: CPU threads, where the peer can use several.

    Returns:
        ``name``, and ``seconds`` a step, ``longer`` (its time step over the common one), ``particles``, ``version``,
        ``velocity`` upwards after each window, the mean over the particles [m/s]; or ``error``, the last line it wrote.
    """
    file, longer = PEERS[name]
    if block.get("device", "cpu") not in DEVICES:
        return {"name": name, "error": f"it does not run on {block['device']}"}
    script = Path(__file__).with_name(file)
    threading = {"QD_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads)}
    try:
        done = subprocess.run(
            [python, str(script), json.dumps({**block, "longer": longer})],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            env=os.environ | threading,
            check=True,
        )
        return {"name": name, "longer": longer, **json.loads(done.stdout.strip().splitlines()[-1])}
    except subprocess.CalledProcessError as error:
        return {"name": name, "error": (error.stderr.strip().splitlines() or [f"exit code {error.returncode}"])[-1]}
    except (OSError, subprocess.TimeoutExpired, ValueError, IndexError) as error:
        return {"name": name, "error": str(error)}
