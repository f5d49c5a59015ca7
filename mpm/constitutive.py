"""Material laws at one particle: fixed-corotated elasticity, J2 return, bulk damage.

Fixed-corotated energy (Stomakhin, Howes, Schroeder and Teran 2012): psi = mu |S - I|^2 + lambda/2 (J - 1)^2 with the
polar decomposition F = R S and J = det F. Each law has a NumPy twin in the tests.
"""

import taichi as ti

# Newton's iteration R <- (R + R^-T)/2 converges quadratically: 5 steps reach rounding for 10 % strain,
# 12 suffice for principal stretches between 0.02 and 50.
POLAR_STEPS = 12
POLAR_TOLERANCE = 1e-12  # squared change of R at which the iteration stops; the error is then its square
RETURN_STEPS = 8  # contraction of the J2 return: 3 steps give 1e-5, 8 give rounding
RETURN_TOLERANCE = 1e-7  # distance from the yield stress that ends the return [-]


@ti.func
def cofactor(m):
    """Cofactor matrix det(m) m^-T."""
    return ti.Matrix(
        [
            [
                m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1],
                m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2],
                m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0],
            ],
            [
                m[0, 2] * m[2, 1] - m[0, 1] * m[2, 2],
                m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0],
                m[0, 1] * m[2, 0] - m[0, 0] * m[2, 1],
            ],
            [
                m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1],
                m[0, 2] * m[1, 0] - m[0, 0] * m[1, 2],
                m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0],
            ],
        ]
    )


@ti.func
def polar_rotation(f):
    """Rotation of the polar decomposition of a matrix with det > 0 (Higham 1986, Newton's iteration)."""
    r = f
    for _ in range(POLAR_STEPS):
        c = cofactor(r)
        det = r[0, 0] * c[0, 0] + r[0, 1] * c[0, 1] + r[0, 2] * c[0, 2]
        new = 0.5 * (r + c / det)
        change = (new - r).norm_sqr()
        r = new
        if change < POLAR_TOLERANCE:
            break
    return r


@ti.func
def mises(s, mu):
    """von Mises equivalent of the Kirchhoff stress 2 mu (S - I) S [Pa]."""
    tau = 2 * mu * (s @ s - s)
    mean = tau.trace() / 3
    dev2 = tau.norm_sqr() - 3 * mean * mean
    return ti.sqrt(1.5 * ti.max(dev2, 0.0))


@ti.func
def j2_return(s, j, mu, yield_stress):
    """Stretch returned to the yield surface of the corotated law itself, at constant volume.

    The usual return of the logarithmic strain overshoots the yield stress of this law by up to 7 % at
    sigma_y / E = 0.1; scaling the deviator of S until the corotated stress itself yields does not.
    """
    out = s
    q = mises(s, mu)
    if q > yield_stress:
        mean = s.trace() / 3
        d = s - mean * ti.Matrix.identity(float, 3)
        a = 1.0
        for _ in range(RETURN_STEPS):
            a *= yield_stress / q
            out = mean * ti.Matrix.identity(float, 3) + a * d
            out *= (j / out.determinant()) ** (1.0 / 3.0)
            q = mises(out, mu)
            if ti.abs(q - yield_stress) < yield_stress * RETURN_TOLERANCE:
                break
    return out


@ti.func
def deviatoric_energy(s, mu):
    """mu |S - I|^2 per volume [J/m^3]."""
    e = s - ti.Matrix.identity(float, 3)
    return mu * e.norm_sqr()


@ti.func
def largest_eigenvalue(a):
    """Largest eigenvalue of a symmetric matrix, trigonometric form (Smith 1961)."""
    q = a.trace() / 3
    b = a - q * ti.Matrix.identity(float, 3)
    p = ti.sqrt(b.norm_sqr() / 6)
    out = q
    if p > 0:
        r = ti.math.clamp(b.determinant() / (2 * p * p * p), -1.0, 1.0)
        out = q + 2 * p * ti.cos(ti.acos(r) / 3)
    return out


@ti.func
def damage_of(kappa, eps0, eps_f):
    """Exponential softening: damage at the largest strain seen so far.

    D = 1 - eps0/kappa exp(-(kappa - eps0)/(eps_f - eps0)), with eps_f = eps0/2 + Gf/(sigma_t h) the energy dissipated
    per volume is Gf/h for a crack band of width h (Oliver 1989; Jirasek and Bauer 2012).
    """
    d = 0.0
    if kappa > eps0:
        d = 1 - eps0 / kappa * ti.exp(-(kappa - eps0) / (eps_f - eps0))
    return d


@ti.func
def degrade(tau, d):
    """Damaged stress: deviator and tensile pressure scaled by 1 - D, compression kept (Amor et al. 2009)."""
    mean = tau.trace() / 3
    keep = ti.min(mean, 0.0)
    eye = ti.Matrix.identity(float, 3)
    return (1 - d) * (tau - keep * eye) + keep * eye
