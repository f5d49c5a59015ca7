#!/usr/bin/env bash
# Somebody whose food and knife cutcal does not have. Needs cutcal and calibrate on the PATH. Give a folder to keep what
# is made.
set -euo pipefail
work=${1:-$(mktemp -d)}
mkdir -p "$work" && cd "$work"

echo "== a food that is not there: the message says what to do"
code=0
cutcal simulate --food tofu 2> message.txt || code=$?
test "$code" = 1
grep -- '--template' message.txt

echo "== begin both from templates, and say what was measured"
cutcal foods --template tofu > tofu.yaml
cutcal knives --template mine > mine.yaml
sed -i.bak 's/height: {value: 0.03, low: 0.027, high: 0.033/height: {value: 0.025, low: 0.024, high: 0.026/' tofu.yaml
sed -i.bak 's/spine:  {value: 2.0e-3/spine:  {value: 1.8e-3/; s/angle:  {value: 2.55/angle:  {value: 2.3/' mine.yaml
cutcal foods tofu.yaml
cutcal knives mine.yaml

echo "== a value alone: the message says how it is written"
code=0
sed 's/    E: .*/    E: 20kPa/' tofu.yaml > slip.yaml
cutcal foods slip.yaml 2> message.txt || code=$?
test "$code" = 1
grep 'write {value' message.txt

echo "== cut it"
cutcal simulate --food tofu.yaml --knife mine.yaml --dx 4mm --out cut
test -s cut/summary.json
