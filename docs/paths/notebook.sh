#!/usr/bin/env bash
# Somebody who works in notebooks. Needs Python with cutcal, nbclient and ipykernel on the PATH. Give a folder to keep
# what is made.
set -euo pipefail
checkout=$(cd "$(dirname "$0")/../.." && pwd)
work=${1:-$(mktemp -d)}
mkdir -p "$work"
cp "$checkout"/docs/notebooks/*.ipynb "$work"
cd "$work"
jupyter execute --inplace first_calibration.ipynb
jupyter execute --inplace next_test.ipynb # goes on from the first
test -s runs/first-calibration/report.pdf
test -s runs/next-test/design.json
