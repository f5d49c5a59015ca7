"""A block between frictionless plates by finite elements, against the closed form of the same law."""

from scipy.optimize import brentq

from fem_reference.press import Elements, press
from mpm import Material, Shape

block = Material(E=1e5, nu=0.35, rho=1000)
mu, lam = block.shear, block.lame
stretch = 0.8


def side(s: float) -> float:
    """Stress across the load, which is zero at the right lateral stretch s."""
    j = stretch * s * s
    return 2 * mu * (s - 1) * s + lam * (j - 1) * j


s = brentq(side, 1.0, 1.3)
j = stretch * s * s
nominal = (2 * mu * (stretch - 1) * stretch + lam * (j - 1) * j) / stretch
exact = -nominal * 0.02 * 0.02

curve = press(Shape("block", 0.02, 0.02, 0.02), block, [0.002, 0.02 * (1 - stretch)], elements=Elements(cells=3))
print(f"finite elements {curve.force[-1]:.4f} N, closed form {exact:.4f} N")
print(f"relative error {abs(curve.force[-1] / exact - 1):.1e}")
