#!/usr/bin/env bash
# Somebody who reads README.md and nothing else: the commands of "Try it", typed into a new clone.
set -euo pipefail
checkout=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

git clone -q "$checkout" "$work/cutcal"
cd "$work/cutcal"
commands=$(awk '/^## Try it/ {on = 1} on && /^```bash/ {inside = 1; next} inside && /^```/ {exit} inside' README.md)
echo "$commands"
bash -euo pipefail -c "$commands"

for file in report.pdf report.html summary.json material.yaml curves.csv; do
  test -s "runs/banana/$file" || { echo "runs/banana/$file is missing" >&2; exit 1; }
done
.venv/bin/cutcal doctor
