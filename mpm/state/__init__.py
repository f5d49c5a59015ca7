"""The state of a simulation: its fields and tables, and what every kernel needs to read and write them."""

from mpm.runtime.compiler import quicken_front_end

quicken_front_end()  # before the first function in Taichi's language is declared
