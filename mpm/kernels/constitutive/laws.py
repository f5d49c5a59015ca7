"""Material laws at one particle: fixed-corotated elasticity, J2 return, bulk damage.

Fixed-corotated energy (Stomakhin, Howes, Schroeder and Teran 2012): psi = mu |V - I|^2 + lambda/2 (J - 1)^2 with the
polar decomposition F = V R and J = det F. All laws are isotropic, so they are written in the left stretch V, which
follows from B = F F^T without the rotation. Symmetric matrices are 6-vectors (xx, yy, zz, yz, xz, xy). Functions that
take or return their six entries one by one also work on several particles at once, each entry a vector with a place for
each particle. Each law has a NumPy twin in the tests.
"""

import taichi as ti

STRETCH_STEPS = 30  # Halley's iteration: 2 steps at 30 % strain, 12 for principal stretches between 0.02 and 50
STRETCH_TOLERANCE = 1e-4  # relative change that ends it; the error is then about its cube
RETURN_STEPS = 8  # contraction of the J2 return: 3 steps give 1e-5, 8 give rounding
CUBE_ROOT_STEPS = 3  # for the volume that a step of the return puts right: of the order of the strain squared
RETURN_TOLERANCE = 1e-7  # distance from the yield stress that ends the return [-]


@ti.func
def unit():
    """The identity."""
    return ti.Vector([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


@ti.func
def full(a):
    """Symmetric matrix as a 3x3 matrix."""
    return ti.Matrix([[a[0], a[5], a[4]], [a[5], a[1], a[3]], [a[4], a[3], a[2]]])


@ti.func
def upper(m):
    """Symmetric part of a 3x3 matrix."""
    return ti.Vector(
        [
            m[0, 0],
            m[1, 1],
            m[2, 2],
            0.5 * (m[1, 2] + m[2, 1]),
            0.5 * (m[0, 2] + m[2, 0]),
            0.5 * (m[0, 1] + m[1, 0]),
        ]
    )


@ti.func
def trace(a):
    """Trace."""
    return a[0] + a[1] + a[2]


@ti.func
def double(a, b):
    """Double contraction a : b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@ti.func
def product_with_transpose(a, b, c, d, e, f, g, h, i):
    """Entries of F F^T from those of F, row by row."""
    xx, yy, zz = a * a + b * b + c * c, d * d + e * e + f * f, g * g + h * h + i * i
    return xx, yy, zz, d * g + e * h + f * i, a * g + b * h + c * i, a * d + b * e + c * f


@ti.func
def left_cauchy_green(f):
    """B = F F^T."""
    xx, yy, zz, yz, xz, xy = product_with_transpose(
        f[0, 0], f[0, 1], f[0, 2], f[1, 0], f[1, 1], f[1, 2], f[2, 0], f[2, 1], f[2, 2]
    )
    return ti.Vector([xx, yy, zz, yz, xz, xy])


@ti.func
def cofactors(xx, yy, zz, yz, xz, xy):
    """Entries of the cofactor matrix of a symmetric matrix."""
    a, b, c = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    return a, b, c, xz * xy - xx * yz, yz * xy - yy * xz, yz * xz - zz * xy


@ti.func
def cofactor(m):
    """Cofactor matrix det(m) m^-1."""
    a, b, c, yz, xz, xy = cofactors(m[0], m[1], m[2], m[3], m[4], m[5])
    return ti.Vector([a, b, c, yz, xz, xy])


@ti.func
def determinant(a):
    """Determinant."""
    c = cofactor(a)
    return a[0] * c[0] + a[5] * c[5] + a[4] * c[4]


@ti.func
def halley(x, first, second, j):
    """Step of Halley's iteration towards the first invariant of V; see :func:`left_stretch`."""
    p = ((x * x - 2 * first) * x - 8 * j) * x + first * first - 4 * second
    d1 = 4 * ((x * x - first) * x - 2 * j)
    d2 = 12 * x * x - 4 * first
    return 2 * p * d1 / (2 * d1 * d1 - p * d2)


@ti.func
def stretch_of(x, first, j, xx, yy, zz, yz, xz, xy):
    """Entries of V from its first invariant x, the trace of B, J and the entries of B; see :func:`left_stretch`."""
    n = 0.5 * (x * x - first)
    a, b, c = xx + n, yy + n, zz + n
    ca, cb, cc, cyz, cxz, cxy = cofactors(a, b, c, yz, xz, xy)
    w = (j - x * n) / (a * ca + xy * cxy + xz * cxz)
    return x + w * ca, x + w * cb, x + w * cc, w * cyz, w * cxz, w * cxy


@ti.func
def left_stretch(b, j):
    """V of the polar decomposition F = V R from B = V V and J = det F > 0, without eigenvalues.

    V = (I1 B + J 1) (B + I2 1)^-1 with the invariants I1, I2 of V (Ting 1985, J. Elasticity 15:319). I1 is the largest
    root of x^4 - 2 tr(B) x^2 - 8 J x + tr(B)^2 - 4 II_B, whose roots are all real (Hoger and Carlson 1984, Quart. Appl.
    Math. 42:113); Halley's iteration comes down to it from sqrt(3 tr B), which is right to second order in the strain.
    """
    first, second = trace(b), trace(cofactor(b))
    x = ti.sqrt(3 * first)
    for _ in range(STRETCH_STEPS):
        change = halley(x, first, second, j)
        x -= change
        if change < STRETCH_TOLERANCE * x:
            break
    xx, yy, zz, yz, xz, xy = stretch_of(x, first, j, b[0], b[1], b[2], b[3], b[4], b[5])
    return ti.Vector([xx, yy, zz, yz, xz, xy])


@ti.func
def mises_squared(xx, yy, zz, yz, xz, xy):
    """Square of the von Mises equivalent of a stress, from its entries."""
    mean = (xx + yy + zz) / 3
    a, b, c = xx - mean, yy - mean, zz - mean
    return 1.5 * (a * a + b * b + c * c) + 3 * (yz * yz + xz * xz + xy * xy)


@ti.func
def cube_root(r):
    """Cube root by Halley's iteration from 1: to rounding between 0.5 and 2, to 2e-7 between 0.1 and 10."""
    y = 0.0 * r + 1.0
    for _ in ti.static(range(CUBE_ROOT_STEPS)):
        y *= (y * y * y + 2 * r) / (2 * y * y * y + r)
    return y


@ti.func
def deviator_stress(xx, yy, zz, yz, xz, xy, mu):
    """Entries of 2 mu (V - 1) V, the Kirchhoff stress without its pressure lambda J (J - 1), from those of V [Pa]."""
    return (
        2 * mu * (xx * xx + xy * xy + xz * xz - xx),
        2 * mu * (xy * xy + yy * yy + yz * yz - yy),
        2 * mu * (xz * xz + yz * yz + zz * zz - zz),
        2 * mu * (xy * xz + yy * yz + yz * zz - yz),
        2 * mu * (xx * xz + xy * yz + xz * zz - xz),
        2 * mu * (xx * xy + xy * yy + xz * yz - xy),
    )


@ti.func
def j2_return(xx, yy, zz, yz, xz, xy, j, mises2, mu, yield_stress):
    """Entries of the left stretches returned to the yield surface of the corotated law itself, at constant volume.

    The usual return of the logarithmic strain overshoots the yield stress of this law by up to 7 % at
    sigma_y / E = 0.1; scaling the deviator of V until the corotated stress itself yields does not.

    Args:
        xx, yy, zz, yz, xz, xy: Entries of V, each a vector with a place for each particle.
        j: Determinants of V.
        mises2: Squares of the von Mises equivalents of their stresses [Pa^2]; those that do not exceed the yield stress
            are given back as they are.
        mu: Shear modulus [Pa].
        yield_stress: Yield stress [Pa].
    """
    flows = mises2 > yield_stress * yield_stress
    mean = (xx + yy + zz) / 3
    dx, dy, dz, dyz, dxz, dxy = xx - mean, yy - mean, zz - mean, yz, xz, xy
    sx, sy, sz, syz, sxz, sxy = xx, yy, zz, yz, xz, xy
    q, a = ti.select(flows, ti.sqrt(mises2), yield_stress), 0.0 * j + 1.0
    for _ in range(RETURN_STEPS):
        a *= yield_stress / q
        vx, vy, vz, vyz, vxz, vxy = mean + a * dx, mean + a * dy, mean + a * dz, a * dyz, a * dxz, a * dxy
        cx, _cy, _cz, _cyz, cxz, cxy = cofactors(vx, vy, vz, vyz, vxz, vxy)
        grow = cube_root(j / (vx * cx + vxy * cxy + vxz * cxz))
        sx, sy, sz = ti.select(flows, grow * vx, xx), ti.select(flows, grow * vy, yy), ti.select(flows, grow * vz, zz)
        syz, sxz, sxy = (
            ti.select(flows, grow * vyz, yz),
            ti.select(flows, grow * vxz, xz),
            ti.select(flows, grow * vxy, xy),
        )
        t = deviator_stress(sx, sy, sz, syz, sxz, sxy, mu)
        q = ti.select(flows, ti.sqrt(mises_squared(t[0], t[1], t[2], t[3], t[4], t[5])), yield_stress)
        if ti.abs(q - yield_stress).max() < yield_stress * RETURN_TOLERANCE:
            break
    return sx, sy, sz, syz, sxz, sxy


@ti.func
def j2_return_one(v, j, mises2, mu, yield_stress):
    """:func:`j2_return` of one particle."""
    xx, yy, zz, yz, xz, xy = j2_return(
        ti.Vector([v[0]]),
        ti.Vector([v[1]]),
        ti.Vector([v[2]]),
        ti.Vector([v[3]]),
        ti.Vector([v[4]]),
        ti.Vector([v[5]]),
        ti.Vector([j]),
        ti.Vector([mises2]),
        mu,
        yield_stress,
    )
    return ti.Vector([xx[0], yy[0], zz[0], yz[0], xz[0], xy[0]])


@ti.func
def deviatoric_energy(v, mu):
    """mu |V - 1|^2 per volume [J/m^3]."""
    e = v - unit()
    return mu * double(e, e)


@ti.func
def rotation(f, v, j):
    """Rotation R of the polar decomposition F = V R, from F, V and J = det F > 0."""
    return full(cofactor(v)) @ f / j


@ti.func
def branch_energy(h, back, j, mu, bulk):
    """Energy of the stress of a Prony branch of share 1, of shape and of volume [J/m^3].

    Its shape has the stress 2 mu (U^2 - U), so that the strain is U^-1 h / (2 mu); its pressure is K J (J - 1).

    Args:
        h: Kirchhoff stress of the branch in the unrotated frame [Pa].
        back: Inverse of the stretch U in that frame.
        j: Its determinant.
        mu: Shear modulus [Pa].
        bulk: Bulk modulus K [Pa].
    """
    pressure = h.trace() / 3
    strain = back @ (h - pressure * ti.Matrix.identity(float, 3))
    return strain.norm_sqr() / (4 * mu), (pressure / j) ** 2 / (2 * bulk)


@ti.func
def norm_squared(xx, yy, zz, yz, xz, xy):
    """Square of the Frobenius norm from the entries."""
    return xx * xx + yy * yy + zz * zz + 2 * (yz * yz + xz * xz + xy * xy)


@ti.func
def replace_stretch(xx, yy, zz, yz, xz, xy, j, rxx, ryy, rzz, ryz, rxz, rxy, a, b, c):
    """One column (a, b, c) of F after its left stretch V gave way to R: of R V^-1 F, from the entries of V and R."""
    cx, cy, cz, cyz, cxz, cxy = cofactors(xx, yy, zz, yz, xz, xy)
    u, v, w = (cx * a + cxy * b + cxz * c) / j, (cxy * a + cy * b + cyz * c) / j, (cxz * a + cyz * b + cz * c) / j
    return rxx * u + rxy * v + rxz * w, rxy * u + ryy * v + ryz * w, rxz * u + ryz * v + rzz * w


@ti.func
def largest_eigenvalue(a):
    """Largest eigenvalue of a symmetric matrix, trigonometric form (Smith 1961)."""
    q = trace(a) / 3
    b = a - q * unit()
    p = ti.sqrt(double(b, b) / 6)
    out = q
    if p > 0:
        r = ti.math.clamp(determinant(b) / (2 * p * p * p), -1.0, 1.0)
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
    keep = ti.min(trace(tau) / 3, 0.0)
    return (1 - d) * (tau - keep * unit()) + keep * unit()
