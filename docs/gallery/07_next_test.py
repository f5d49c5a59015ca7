"""Which test narrows R most, after a calibration."""

from cutcal import Calibration, Design

fit = Calibration("banana", "banana_reconstructed", height=0.03, length=0.03, fit=["E", "R"], dx=5e-3, budget=13)
result = fit.run("runs/gallery-no-width", resume=True)  # nothing is simulated twice

answer = Design(result, asked="R").run("runs/gallery-next", resume=True)
answer.plot().figure.savefig("next_test.png")
