#!/usr/bin/env bash
# Somebody who trains robots: a small dataset, its export, and the numbers read back. Needs cutcal with the extras robot
# and data on the PATH. Give a folder to keep what is made.
set -euo pipefail
work=${1:-$(mktemp -d)}
mkdir -p "$work" && cd "$work"

cutcal dataset generate --episodes 2 --food grape --task split --style press --workers 1 --out cuts
cutcal dataset export cuts --out lerobot

python - << 'PYTHON'
import glob

import h5py
import pyarrow.parquet as parquet

for path in sorted(glob.glob("cuts/*.h5")):
    with h5py.File(path) as file:
        for name, episode in file.items():
            force = episode["mpm/force"]
            print(name, force.shape, "largest force", round(float(abs(force[:]).max()), 2), "N")
for path in sorted(glob.glob("lerobot/data/**/*.parquet", recursive=True)):
    table = parquet.read_table(path)
    print(path, table.num_rows, "rows of", ", ".join(table.column_names))
    assert table.num_rows > 0
PYTHON
test -s lerobot/meta/info.json
