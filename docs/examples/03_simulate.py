"""One cut from a scene: a thin blade through a prism needs R times its width."""

from math import radians

from mpm import EdgeLaw, Food, Knife, Material, Motion, Numerics, Scene, Shape
from mpm.runtime import Runtime
from mpm.solver import simulate

flesh = Material(E=1e6, nu=0.35, rho=1000, yield_stress=2e5, R=300.0, R_initiation=300.0)
scene = Scene(
    Food(Shape("block", length=0.030, width=0.024, height=0.024), flesh),
    Knife("thin", spine=0.2e-3, angle=radians(1.0), height=0.05, length=0.4),
    Motion(stroke=0.018),
    edge=EdgeLaw(zone=3e-3),
    numerics=Numerics(dx=3e-3),
)
record = simulate(scene, runtime=Runtime(threads=1))

late = record.stroke > 0.010
plateau = record.resolved[late].mean()
print(f"{record.particles} particles, {record.steps} steps, {record.wall:.1f} s")
print(f"momentum balance closes to {record.momentum_residual:.1e} of the peak")
print("where the work went [J]:", {name: round(value, 5) for name, value in record.budget.items()})
print(f"plateau {plateau:.3f} N, R times width {flesh.R * 0.024:.3f} N")
