"""Move the blade by half a cell: contact by particles hardly notices, contact by nodes loses the blade."""

from math import radians

from mpm import EdgeLaw, Food, Knife, Material, Motion, Numerics, Scene, Shape
from mpm.runtime import Runtime
from mpm.solver import simulate

flesh = Material(E=1e6, nu=0.35, rho=1000, yield_stress=2e5, R=100.0, R_initiation=100.0, mu=0.3)
work = {}
for contact in ("cohesive", "nodal"):
    for offset in (0.0, 0.5):
        scene = Scene(
            Food(Shape("block", length=0.024, width=0.012, height=0.018), flesh),
            Knife("wedge", spine=1.5e-3, angle=radians(8.6), height=0.0104, length=0.1),
            Motion(stroke=0.009, mach=0.02),
            edge=EdgeLaw(zone=3e-3),
            numerics=Numerics(dx=3e-3, contact=contact, grid_shift=(0.0, offset, 0.0)),
        )
        record = simulate(scene, runtime=Runtime(threads=1))
        work[contact, offset] = record.work
        print(f"{contact:9s} offset {offset}: peak {record.peak:6.3f} N, work {1e3 * record.work:6.2f} mJ")

for contact in ("cohesive", "nodal"):
    print(f"{contact}: half a cell changes the work by {work[contact, 0.5] / work[contact, 0.0] - 1:+.1%}")
