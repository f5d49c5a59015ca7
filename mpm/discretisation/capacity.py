"""How much room the fields have: few sizes, so that scenes of many sizes share what is compiled once."""

# The smallest size, the factor by which sizes grow, up to where, and the step by which they grow beyond.
PARTICLE_ROOM = (4096, 4, 65_536, 65_536)
EXTRA_PARTICLES = 132  # beside that: 33 blocks of four
NODE_ROOM = (24, 2, 96, 32)
BATCH_ROOM = (1, 2, 64, 64)


def _capacity(size: int, room: tuple[int, int, int, int]) -> int:
    """The smallest of the sizes that holds ``size`` entries."""
    out, factor, most, step = room
    while out < min(size, most):
        out *= factor
    return out if size <= out else out + -(-(size - out) // step) * step


def particle_capacity(n: int) -> int:
    """Particles that fields for n of them have room for.

    Off a power of two, or what belongs to a particle would share the cache's sets in all fields (docs/theory.md,
    "Measured choices").
    """
    return _capacity(n, PARTICLE_ROOM) + EXTRA_PARTICLES


def node_capacity(nodes: int) -> int:
    """Nodes along an axis that a grid of so many has room for; odd, or neighbours would share the cache's sets."""
    return _capacity(nodes, NODE_ROOM) + 1


def batch_capacity(cuts: int) -> int:
    """Cuts side by side that fields for so many have room for."""
    return _capacity(cuts, BATCH_ROOM)
