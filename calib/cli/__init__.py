"""The command line: one file per sub-command."""

from __future__ import annotations

import os

# The fit's matrices are small and the simulations have the cores: more threads for linear algebra only get in their way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
