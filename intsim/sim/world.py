"""Where a policy acts or a demonstration is made: name and settings of the environment; needs no simulator."""

from __future__ import annotations

from dataclasses import dataclass

ENV_ID = "CutFood-v1"
"""Name under which Gymnasium knows the environment."""
EPISODE_STEPS = 400
"""Control steps of an episode in the environment at most: 20 s."""


@dataclass(frozen=True)
class World:
    """Where a policy is evaluated.

    Attributes:
        coupled: Whether the food resists.
        stiffness: Of all the arm's joints [N m/rad], with ManiSkill's damping; libfranka's example gains without it.
        knife: Name of the knife.
        pixels: Width and height of the pictures that a policy is given; 0 for none, which needs no renderer.
    """

    coupled: bool = True
    stiffness: float | None = None
    knife: str = "kitchen"
    pixels: int = 0
