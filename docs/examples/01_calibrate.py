"""Fit two properties of a banana to the bundled trace, on cells of 5 mm: quick, and too coarse to be used."""

from pathlib import Path

from cutcal import Calibration, Trace

FORCE_DATA = Path(__file__).parents[2] / "force_data"


def main() -> None:
    """Calibrate and say what came out."""
    trace = Trace.read(FORCE_DATA / "banana_reconstructed.csv")
    fit = Calibration("banana", trace, height=0.03, length=0.03, fit=["E", "R"], dx=5e-3, budget=13, workers=1)
    result = fit.run("runs/example-banana")
    print(result.parameters[["value", "unit", "low95", "high95", "verdict"]])
    for line in result.summary["verdicts"]:
        if line["passed"] is False:
            print(f"failed: {line['name']}, {line['value']:.3g} (limit {line['limit']:.3g})")
    print(f"R = {result.material.value('R'):.1f} J/m^2")


if __name__ == "__main__":  # workers import this file
    main()
