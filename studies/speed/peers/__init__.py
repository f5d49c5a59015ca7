"""The elastic block in other simulators, each through its own package and in an interpreter of its own.

Their packages want other versions of what this one needs, so they live in an environment of their own:

    python3 -m venv peers && peers/bin/pip install warp-lang torch genesis-world numpy
    cutcal bench --peers peers/bin/python --out runs/bench
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

PEERS = {"Warp": "warp_block.py", "Genesis": "genesis_block.py"}
PATIENCE = 900.0  # a peer that has not ended by then is given up [s]; compiling takes them up to a minute


def measure(python: str, name: str, block: dict[str, Any], threads: int) -> dict[str, Any]:
    """Time of a step of the block in a peer.

    Args:
        python: Interpreter that has the peer's package.
        name: Peer, a key of PEERS.
        block: ``dx`` [m], ``nodes`` (3), ``low`` corner (3) [m], ``counts`` of particles (3), ``dt`` [s], ``rho``
            [kg/m^3], ``mu`` and ``lam`` [Pa], ``floor`` (node), ``steps`` in a turn, ``repeats`` (turns).
        threads: CPU threads, where the peer can use several.

    Returns:
        ``name``, and ``seconds`` a step, ``particles``, ``version``; or ``error``, the last line it wrote.
    """
    script = Path(__file__).with_name(PEERS[name])
    threading = {"QD_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads)}
    try:
        done = subprocess.run(
            [python, str(script), json.dumps(block)],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            env=os.environ | threading,
            check=True,
        )
        return {"name": name, **json.loads(done.stdout.strip().splitlines()[-1])}
    except subprocess.CalledProcessError as error:
        return {"name": name, "error": (error.stderr.strip().splitlines() or [f"exit code {error.returncode}"])[-1]}
    except (OSError, subprocess.TimeoutExpired, ValueError, IndexError) as error:
        return {"name": name, "error": str(error)}
