"""Order, index and uncertainty of numbers from several grids; no simulation."""

from studies.convergence.gci import estimate

cells = [3e-3, 2e-3, 1.5e-3, 1e-3]
work = [0.6197, 0.6158, 0.6134, 0.6109]  # of an apple, in J

for noise in (0.0, 0.0012):  # standard deviation of runs that should agree
    e = estimate(cells, work, repeat_sd=noise)
    order = "none" if e.order is None else f"{e.order:.2f}"
    print(f"noise {noise}: {e.verdict}, order {order}, GCI {e.gci:.2%}, uncertainty {e.uncertainty:.2%}")

# The example of Celik et al. (2008), table 1: order 1.53, extrapolated 6.1685, index 2.2 %.
celik = estimate([1.0, 1.5, 2.0], [6.063, 5.972, 5.863])
print(f"order {celik.order:.2f}, extrapolated {celik.extrapolated:.4f}, GCI {celik.gci:.1%}")
