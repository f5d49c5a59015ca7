"""Constitutive update: deformation gradient and Kirchhoff stress of the particles.

Those that are elastic or flow are done for a block of particles at once (:func:`elastic_block`), the others one by one
(:func:`particle_stress`). The laws themselves are in :mod:`mpm.kernels.constitutive.laws`.
"""

import taichi as ti

from mpm.kernels.constitutive.damage import update_damage
from mpm.kernels.constitutive.laws import (
    STRETCH_TOLERANCE,
    branch_energy,
    cofactor,
    cofactors,
    damage_of,
    degrade,
    deviator_stress,
    deviatoric_energy,
    double,
    full,
    halley,
    j2_return,
    j2_return_one,
    left_cauchy_green,
    left_stretch,
    mises_squared,
    norm_squared,
    product_with_transpose,
    replace_stretch,
    rotation,
    stretch_of,
    trace,
    unit,
    upper,
)
from mpm.state.accessors import deformation_gradient, velocity_gradient
from mpm.state.tables import (
    EPS0,
    EPSF,
    ETA_B,
    ETA_S,
    LAM,
    MU,
    PLASTIC_LOSS,
    RELAXING_BULK,
    STRETCH,
    STRETCH_AT_REST,
    VISCOUS_LOSS,
    YIELD,
)


@ti.func
def constitutive_update(
    s: ti.template(),
    cut: ti.template(),
    p: ti.template(),
    block: ti.template(),
    lane: ti.template(),
    dt: ti.template(),
    loss: ti.template(),
    tau: ti.template(),
):
    """Advance F of one particle and find its Kirchhoff stress, as far as :func:`elastic_block` has not done so.

    Args:
        loss: Set to its (plastic, damage, viscous loss per volume [J/m^3], inverted); 0 before.
        tau: Set to the stress [Pa], xx, yy, zz, yz, xz, xy.
    """
    one_by_one = True
    if ti.static(s.branches == 0):
        one_by_one = s.tau[cut, block, STRETCH][lane] < 0
    if one_by_one:
        loss, tau = particle_stress(s, cut, p, block, lane, dt)
        for r in ti.static(range(6)):
            s.tau[cut, block, r][lane] = tau[r]
    else:
        for r in ti.static(range(6)):
            tau[r] = s.tau[cut, block, r][lane]
        loss[2], loss[0] = s.tau[cut, block, VISCOUS_LOSS][lane], s.tau[cut, block, PLASTIC_LOSS][lane]


@ti.func
def prony_stress(s: ti.template(), cut, p, f, v, j, mu, lam):
    """Prony series on the deviator, and on a part of the pressure, in the unrotated frame (Simo 1987).

    Args:
        f: Deformation gradient.
        v: Its left stretch.
        j: Its determinant.
        mu: Shear modulus [Pa].
        lam: First Lame constant [Pa].

    Returns:
        Stress to add [Pa], and loss per volume [J/m^3].
    """
    volume, bulk = s.par[cut, RELAXING_BULK], lam + 2 * mu / 3
    r = rotation(f, v, j)
    u = r.transpose() @ f
    back = u.inverse()
    now = 2 * mu * (u @ u - u)
    now += (volume * bulk * j * (j - 1) - now.trace() / 3) * ti.Matrix.identity(float, 3)
    add, lost = ti.Matrix.zero(float, 3, 3), 0.0
    for b in ti.static(range(s.branches)):
        share, rate = s.prony_share[cut, b], s.prony_rate[cut, b]
        decay = ti.exp(-rate)
        h = decay * s.prony_stress[cut, b, p] + share * (1 - decay) / rate * (now - s.prony_before[cut, p])
        s.prony_stress[cut, b, p] = h
        add += h - share * now
        shape, whole = branch_energy(h, back, j, mu, bulk)
        lost += 2 * rate * shape / share
        if volume > 0:
            lost += 2 * rate * whole / (volume * share)
    s.prony_before[cut, p] = now
    return upper(r @ add @ r.transpose()), lost


@ti.func
def gradient_entry(s: ti.template(), cut, block, row, column):
    """One entry of the velocity gradient for all particles of a block [1/s]."""
    return ti.Vector([s.C[cut, block * s.lanes + lane, column][row] for lane in range(s.lanes)])


@ti.func
def gradient_row(s: ti.template(), cut: ti.template(), block: ti.template(), row: ti.template()):
    """One row of the velocity gradient for all particles of a block [1/s]."""
    return (
        gradient_entry(s, cut, block, row, 0),
        gradient_entry(s, cut, block, row, 1),
        gradient_entry(s, cut, block, row, 2),
    )


@ti.func
def elastic_block(s: ti.template(), cut, block, dt):
    """Advance F of a block of particles and find their Kirchhoff stress and viscous loss, all at once.

    Those that are damaged or inverted, or whose stretch has not converged, are left as they are and marked;
    :func:`particle_stress` does them one by one.
    """
    a0, a1, a2 = s.F[cut, block, 0], s.F[cut, block, 1], s.F[cut, block, 2]
    b0, b1, b2 = s.F[cut, block, 3], s.F[cut, block, 4], s.F[cut, block, 5]
    c0, c1, c2 = s.F[cut, block, 6], s.F[cut, block, 7], s.F[cut, block, 8]
    lxx, lxy, lxz = gradient_row(s, cut, block, 0)
    lyx, lyy, lyz = gradient_row(s, cut, block, 1)
    lzx, lzy, lzz = gradient_row(s, cut, block, 2)
    d0 = a0 + dt * (lxx * a0 + lxy * b0 + lxz * c0)
    d1 = a1 + dt * (lxx * a1 + lxy * b1 + lxz * c1)
    d2 = a2 + dt * (lxx * a2 + lxy * b2 + lxz * c2)
    e0 = b0 + dt * (lyx * a0 + lyy * b0 + lyz * c0)
    e1 = b1 + dt * (lyx * a1 + lyy * b1 + lyz * c1)
    e2 = b2 + dt * (lyx * a2 + lyy * b2 + lyz * c2)
    f0 = c0 + dt * (lzx * a0 + lzy * b0 + lzz * c0)
    f1 = c1 + dt * (lzx * a1 + lzy * b1 + lzz * c1)
    f2 = c2 + dt * (lzx * a2 + lzy * b2 + lzz * c2)
    j = d0 * (e1 * f2 - e2 * f1) + d1 * (e2 * f0 - e0 * f2) + d2 * (e0 * f1 - e1 * f0)
    xx, yy, zz, yz, xz, xy = product_with_transpose(d0, d1, d2, e0, e1, e2, f0, f1, f2)
    ca, cb, cc, _, _, _ = cofactors(xx, yy, zz, yz, xz, xy)
    first, second = xx + yy + zz, ca + cb + cc
    x = ti.abs(s.tau[cut, block, STRETCH])  # of the last step: one iteration finds what has changed since
    change = halley(x, first, second, j)
    x -= change
    found = ti.abs(change) <= STRETCH_TOLERANCE * x
    if not found.all():
        x = ti.sqrt(3 * first)
        x -= halley(x, first, second, j)
        x -= halley(x, first, second, j)
        change = halley(x, first, second, j)
        x -= change
        found = ti.abs(change) <= STRETCH_TOLERANCE * x
    vxx, vyy, vzz, vyz, vxz, vxy = stretch_of(x, first, j, xx, yy, zz, yz, xz, xy)
    mu, lam = s.par[cut, MU], s.par[cut, LAM]
    mises2 = mises_squared(xx - vxx, yy - vyy, zz - vzz, yz - vyz, xz - vxz, xy - vxy) * (4 * mu * mu)
    plastic = 0.0 * j
    if mises2.max() > s.par[cut, YIELD] ** 2:
        rxx, ryy, rzz, ryz, rxz, rxy = j2_return(vxx, vyy, vzz, vyz, vxz, vxy, j, mises2, mu, s.par[cut, YIELD])
        plastic = norm_squared(vxx - 1, vyy - 1, vzz - 1, vyz, vxz, vxy)
        plastic = mu * (plastic - norm_squared(rxx - 1, ryy - 1, rzz - 1, ryz, rxz, rxy))
        flows = mises2 > s.par[cut, YIELD] ** 2
        h0, h1, h2 = replace_stretch(vxx, vyy, vzz, vyz, vxz, vxy, j, rxx, ryy, rzz, ryz, rxz, rxy, d0, e0, f0)
        d0, e0, f0 = ti.select(flows, h0, d0), ti.select(flows, h1, e0), ti.select(flows, h2, f0)
        h0, h1, h2 = replace_stretch(vxx, vyy, vzz, vyz, vxz, vxy, j, rxx, ryy, rzz, ryz, rxz, rxy, d1, e1, f1)
        d1, e1, f1 = ti.select(flows, h0, d1), ti.select(flows, h1, e1), ti.select(flows, h2, f1)
        h0, h1, h2 = replace_stretch(vxx, vyy, vzz, vyz, vxz, vxy, j, rxx, ryy, rzz, ryz, rxz, rxy, d2, e2, f2)
        d2, e2, f2 = ti.select(flows, h0, d2), ti.select(flows, h1, e2), ti.select(flows, h2, f2)
        vxx, vyy, vzz, vyz, vxz, vxy = rxx, ryy, rzz, ryz, rxz, rxy
        x = rxx + ryy + rzz
    txx, tyy, tzz, tyz, txz, txy = deviator_stress(vxx, vyy, vzz, vyz, vxz, vxy, mu)
    strain2 = 0.0 * j
    if ti.static(s.damage):
        strain2 = norm_squared(vxx - 1, vyy - 1, vzz - 1, vyz, vxz, vxy)
    swell = lxx + lyy + lzz
    shear, bulk = 2 * s.par[cut, ETA_S] * j, s.par[cut, ETA_B] * j * swell
    syz, sxz, sxy = 0.5 * (lyz + lzy), 0.5 * (lxz + lzx), 0.5 * (lxy + lyx)
    dxx, dyy, dzz = lxx - swell / 3, lyy - swell / 3, lzz - swell / 3
    press = lam * j * (j - 1) + bulk
    heat = shear * (dxx * dxx + dyy * dyy + dzz * dzz + 2 * (syz * syz + sxz * sxz + sxy * sxy)) + bulk * swell
    eps0 = s.par[cut, EPS0]
    unfit = (j <= 0) | (found == 0)
    odd = unfit
    if ti.static(s.damage):
        odd |= (strain2 > eps0 * eps0) & (eps0 > 0)
        for lane in ti.static(range(s.lanes)):
            p = block * s.lanes + lane
            odd[lane] |= (ti.max(s.kappa[cut, p], s.driving_strain[cut, p]) > eps0) & (eps0 > 0)
    s.tau[cut, block, STRETCH] = ti.select(unfit, -STRETCH_AT_REST, ti.select(odd, -x, x))
    for r, new, old in ti.static(
        (
            (0, d0, a0),
            (1, d1, a1),
            (2, d2, a2),
            (3, e0, b0),
            (4, e1, b1),
            (5, e2, b2),
            (6, f0, c0),
            (7, f1, c1),
            (8, f2, c2),
        )
    ):
        s.F[cut, block, r] = ti.select(odd, old, new)
    for r, value in ti.static(
        (
            (0, txx + press + shear * dxx),
            (1, tyy + press + shear * dyy),
            (2, tzz + press + shear * dzz),
            (3, tyz + shear * syz),
            (4, txz + shear * sxz),
            (5, txy + shear * sxy),
            (VISCOUS_LOSS, heat * dt),
            (PLASTIC_LOSS, plastic),
        )
    ):
        s.tau[cut, block, r] = value


@ti.func
def particle_stress(s: ti.template(), cut, p, block, lane, dt):
    """Advance F of one particle by all its laws; returns loss and stress as :func:`constitutive_update` gives them."""
    c, old = velocity_gradient(s, cut, p), deformation_gradient(s, cut, p)
    f = old + dt * (c @ old)
    j = f.determinant()
    tau = 0.0 * unit()
    plastic, lost, heat, bad = 0.0, 0.0, 0.0, 0.0
    if j > 0:
        mu, lam = s.par[cut, MU], s.par[cut, LAM]
        b = left_cauchy_green(f)
        v = left_stretch(b, j)
        tau = 2 * mu * (b - v)
        mises2 = mises_squared(tau[0], tau[1], tau[2], tau[3], tau[4], tau[5])
        if mises2 > s.par[cut, YIELD] ** 2:
            back = j2_return_one(v, j, mises2, mu, s.par[cut, YIELD])
            plastic = deviatoric_energy(v, mu) - deviatoric_energy(back, mu)
            if ti.static(s.damage):  # what is damaged flows under the part of the stress that is left
                plastic *= 1.0 - damage_of(s.kappa[cut, p], s.par[cut, EPS0], s.par[cut, EPSF])
            f = full(back) @ (full(cofactor(v)) @ f) / j
            v = back
            txx, tyy, tzz, tyz, txz, txy = deviator_stress(v[0], v[1], v[2], v[3], v[4], v[5], mu)
            tau = ti.Vector([txx, tyy, tzz, tyz, txz, txy])
        tau += lam * j * (j - 1) * unit()
        if ti.static(s.branches > 0):
            add, loss = prony_stress(s, cut, p, f, v, j, mu, lam)
            tau += add
            heat += loss
        if ti.static(s.damage):
            d, loss = update_damage(s, cut, p, v, j, mu, lam)
            lost += loss
            tau = degrade(tau, d)
        rate = upper(c)
        swell = trace(rate)
        drag = j * (2 * s.par[cut, ETA_S] * (rate - swell / 3 * unit()) + s.par[cut, ETA_B] * swell * unit())
        heat += double(drag, rate) * dt
        tau += drag
        for r, k in ti.static(ti.ndrange(3, 3)):
            s.F[cut, block, 3 * r + k][lane] = f[r, k]
    else:
        bad = 1.0
    return ti.Vector([plastic, lost, heat, bad]), tau
