"""The posterior over everything plausible: waves of simulations, an emulator of the curve, nested sampling, modes."""
