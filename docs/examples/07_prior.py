"""Which forces the literature predicts of a food before any trace, from the recorded draws."""

import json
from pathlib import Path

import pandas as pd

from cutcal import Food

FOLDER = Path(__file__).parents[2] / "force_data" / "prior_predictive"
document = json.loads((FOLDER / "prior.json").read_text(encoding="utf-8"))

for name in ("banana", "cucumber", "potato"):
    low, high = Food.load(name).prior("R")
    peak = document["foods"][name]["peak_N"]
    band = f"{peak['q025']:.1f} to {peak['q975']:.0f} N"
    print(f"{name:9s} R {low:g} to {high:g} J/m^2, peak {peak['default']:.1f} N, 95 % of the draws {band}")

curves = pd.read_csv(FOLDER / "banana.csv", comment="#")
print("columns:", ", ".join(curves.columns[:4]), "...")
measured = 12.5  # published peak of a banana [N]
inside = document["foods"]["banana"]["peak_N"]["q025"] < measured < document["foods"]["banana"]["peak_N"]["q975"]
print("the published peak lies in the band:", inside)
