"""The time step on the device, a module for each part of the method.

:mod:`mpm.step.time_step` says in which order they act. Each part is a set of functions that take the
:class:`mpm.state.state.State` first, so that a law is replaced by another module with the same functions: the crack
(:mod:`mpm.kernels.crack`), the edge's law (:mod:`mpm.kernels.cohesive_law`) and its reaction
(:mod:`mpm.kernels.cutting_edge`), contact (:mod:`mpm.kernels.surface_contact`), material
(:mod:`mpm.kernels.constitutive`, :mod:`mpm.kernels.stress`, :mod:`mpm.kernels.damage`).
"""
