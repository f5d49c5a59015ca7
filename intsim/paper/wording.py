"""Who moved the knife and where, in words, and how that differs from the paper's experiment."""

from __future__ import annotations

from collections.abc import Sequence

from intsim.outcomes import EvaluationSettings
from intsim.policy.oracles import POLICIES
from intsim.task.suites import FOODS

MOST_NAMED = 3  # foods that a sentence names; more are counted


def world_words(settings: EvaluationSettings) -> str:
    """Where an evaluation took place."""
    world = settings.world
    if world is None:
        return "the plain table, each cut then in the solver" if settings.severing else "the plain table"
    arm = "" if world.stiffness is None else f" ({world.stiffness:g} N m/rad)"
    return f"a robot{arm} and food that resists" if world.coupled else f"a robot{arm} and food that does not resist"


def policy_words(settings: EvaluationSettings) -> str:
    """Who moved the knife, with the error of the noisy oracle."""
    sigma = "" if settings.sigma_m is None else f" (error of {1e3 * settings.sigma_m:g} mm)"
    return f"{settings.policy}{sigma}"


def policy_differs(settings: EvaluationSettings, models: Sequence[str]) -> str:
    """Who moved the knife in ours, and in the paper."""
    name = settings.policy
    if name in POLICIES:
        ours = f"({name}) is a program that reads the sentence and is given place and size of the foods in numbers"
    elif name.startswith("clone of "):
        ours = "is a small network that is given place and size of the foods in numbers, and no picture"
    elif name.startswith("remote "):
        ours = "is asked of a server, and what it has learnt is its owner's word"
    else:
        ours = f"is {name}"
    several = len(models) > 1
    theirs = f"{', '.join(models[:-1])} and {models[-1]}, which see" if several else f"{models[0]}, which sees"
    return (
        f"Ours {ours}; the paper's {'are' if several else 'is'} {theirs} pictures and learnt from its training split."
    )


def training_differs(settings: EvaluationSettings, figure: str) -> str:
    """What ours has learnt from, where the figure is about learning; empty where that is as in the paper."""
    trained = settings.trained
    if figure == "fig6" and trained is None:
        return "Ours has not learnt, so that no food and no word is new to it."
    if figure == "fig8" and (trained is None or trained.ratio is None):
        return (
            "Ours has not learnt one cut alone: its rates are those of the tested tasks, whatever a row was trained on."
        )
    if trained is None or trained.foods is None or set(trained.foods) >= set(FOODS):
        return ""
    few = len(trained.foods) <= MOST_NAMED
    foods = f"{', '.join(trained.foods)} alone" if few else f"{len(trained.foods)} foods"
    return f"Ours has learnt from {foods}."


def world_differs(settings: EvaluationSettings) -> str:
    """Where ours acted, and the paper's."""
    if settings.world is not None:
        stiffness = settings.world.stiffness
        gains = "libfranka's example gains" if stiffness is None else f"{stiffness:g} N m/rad in every joint"
        return f"Ours moves a Panda in ManiSkill, as the paper's does, with {gains}; the paper does not say its gains."
    if settings.severing:
        arm = "a rigid arm" if settings.arm.stiffness is None else f"an arm of {settings.arm.stiffness:.0f} N/m"
        return (
            "Ours moves the edge over a plain table, without a robot, and the cut is simulated afterwards behind "
            f"{arm}; the paper's arm is a Panda in ManiSkill."
        )
    return "Ours moves the edge over a plain table, without a robot; the paper's arm is a Panda in ManiSkill."
