"""Traces fitted together: shared flesh, and what each specimen has of its own.

A parameter named ``R_skin@cut2`` belongs to the trace ``cut2`` alone, and ``mu@edc`` to the cuts of the knife ``edc``;
one without ``@`` is shared by all. Data rows of
the traces stand one after the other, then the priors of all parameters, each once. A joint evaluation is one
simulation for each trace.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from types import MappingProxyType

import numpy as np

from calib.material.properties import property_of
from calib.problem.objective import Objective, ObjectiveTerm
from calib.problem.parameters import Parameter, ParameterSet, PriorCorrelation, parameter_of
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluation, Evaluator
from mpm.arrays import FloatArray


def residual(
    objective: JointObjective | Objective, curves: Sequence[FloatArray], fractions: Sequence[float], z: FloatArray
) -> FloatArray:
    """All rows of an objective: data of each trace in turn, then priors.

    Args:
        objective: The objective.
        curves: Smoothed force of each trace's simulation [N], shape (n,) each.
        fractions: Part of its stroke that each completed [-].
        z: Internal coordinates [-] (p,).

    Returns:
        The rows [-] (rows,).
    """
    return residuals(objective, [m[None] for m in curves], np.array(fractions)[:, None], z[None])[0]


def residuals(
    objective: JointObjective | Objective, curves: Sequence[FloatArray], fractions: FloatArray, z: FloatArray
) -> FloatArray:
    """All rows of an objective for q materials at once.

    Args:
        objective: The objective.
        curves: Smoothed force of each trace's simulations [N], shape (q, n) each.
        fractions: Part of its stroke that each completed [-], by trace (t, q).
        z: Internal coordinates [-] (q, p).

    Returns:
        The rows [-] (q, rows).
    """
    data = [t.objective.data_residuals(m, f) for t, m, f in zip(objective.terms, curves, fractions, strict=True)]
    return np.concatenate([*data, objective.parameters.prior_residual(z)], axis=1)


def _with_common(correlations: Mapping[tuple[str, str], float]) -> tuple[PriorCorrelation, ...]:
    """Correlations by pair, and those that follow between what has a partner in common and is independent beside it."""
    out = [PriorCorrelation(*pair, value) for pair, value in correlations.items()]
    for (one, a), (other, b) in combinations(correlations.items(), 2):
        if set(one) & set(other):
            first, second = sorted(set(one) ^ set(other))
            out.append(PriorCorrelation(first, second, a * b))
    return tuple(out)


@dataclass(frozen=True)
class JointObjective:
    """Residual vector and chi-square of joint evaluations.

    Attributes:
        parameters: All parameters with their priors.
        terms: One per trace.
        guesses: Points in internal coordinates that a search tries first, each (p,).
    """

    parameters: ParameterSet
    terms: tuple[ObjectiveTerm, ...]
    guesses: tuple[FloatArray, ...] = ()

    @classmethod
    def of(
        cls,
        objectives: Mapping[str, Objective],
        shared: Sequence[str],
        groups: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
    ) -> JointObjective:
        """Join objectives by the name of their trace.

        Args:
            objectives: Each over the properties that its simulation takes.
            shared: Which of them are the same for all traces; priors and start values are the first one's.
            groups: What some traces share with each other alone: by trace the name of its group, by property.

        Returns:
            The joint objective. Its guesses are those of the traces, the first of each together and so on, with the
            mean of what they share.
        """
        places: dict[str, int] = {}
        items: list[Parameter] = []
        correlations: dict[tuple[str, str], float] = {}
        terms = []
        for trace, objective in objectives.items():
            index = []
            for p in objective.parameters:
                owner = groups.get(trace, {}).get(p.name, trace)
                name = p.name if p.name in shared else parameter_of(p.name, owner)
                if name not in places:
                    places[name] = len(items)
                    items.append(replace(p, name=name))
                index.append(places[name])
            terms.append(ObjectiveTerm(trace, objective, np.array(index)))
            own = dict(zip(objective.parameters.names, (items[k].name for k in index), strict=True))
            correlations |= {(own[c.first], own[c.second]): c.value for c in objective.parameters.correlations}
        joint = cls(ParameterSet(tuple(items), _with_common(correlations)), tuple(terms))
        return replace(joint, guesses=joint._joined_guesses())

    def _joined_guesses(self) -> tuple[FloatArray, ...]:
        """Guesses from those of the traces: the first of each together, with the mean of what they share, and so on."""
        most = max(len(t.objective.guesses) for t in self.terms)
        out = []
        for k in range(most):
            total, count = np.zeros(len(self.parameters)), np.zeros(len(self.parameters))
            for term in self.terms:
                if k < len(term.objective.guesses):
                    total[term.index] += term.objective.guesses[k]
                    count[term.index] += 1
            out.append(np.where(count > 0, total / np.maximum(count, 1), self.parameters.start))
        return tuple(out)

    @property
    def effective_rows(self) -> float:
        """Effective number of independent data, all traces together [-]."""
        return sum(t.objective.effective_rows for t in self.terms)

    def score(self, evaluation: Evaluation, *, coarse: bool = False, stage: str = "design") -> ScoredRun:
        """Curves and residual vector of a joint evaluation.

        Args:
            evaluation: The simulations, one part per trace.
            coarse: Whether they were run at the coarse resolution.
            stage: Why they were run.

        Returns:
            The run with its residual, which is always finite.
        """
        z = self.parameters.to_vector(evaluation.parameters)
        parts = tuple(
            t.objective.score(e, coarse=coarse, stage=stage) for t, e in zip(self.terms, evaluation.parts, strict=True)
        )
        fractions = [e.completed for e in evaluation.parts]
        rows = residual(self, [part.curve for part in parts], fractions, z)
        return ScoredRun(z, evaluation, np.concatenate([part.curve for part in parts]), rows, coarse, stage, parts)


class JointEvaluator:
    """Evaluates each candidate for all traces.

    Args:
        objective: The joint objective.
        evaluators: One per trace, in its order.
    """

    def __init__(self, objective: JointObjective, evaluators: Sequence[Evaluator]) -> None:
        self.objective, self.evaluators = objective, evaluators

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Run each candidate on each trace, trace by trace, so that a batch keeps all workers busy."""
        names = self.objective.parameters.names
        parts: list[list[Evaluation]] = [[] for _ in batch]
        for term, evaluator in zip(self.objective.terms, self.evaluators, strict=True):
            taken = [(property_of(names[k]), names[k]) for k in term.index]
            asked = [{taken_as: values[name] for taken_as, name in taken} for values in batch]
            for evaluation in sorted(evaluator.evaluate(asked), key=lambda e: e.index):
                parts[evaluation.index].append(evaluation)
        for index, (values, runs) in enumerate(zip(batch, parts, strict=True)):
            yield _join(index, values, runs)


def _join(index: int, values: Mapping[str, float], runs: Sequence[Evaluation]) -> Evaluation:
    """One evaluation of several runs: as good as the worst of them."""
    worst = min(runs, key=lambda e: (e.ok, e.fraction))
    return Evaluation(
        index=index,
        parameters=dict(values),
        status=worst.status,
        reason=worst.reason,
        fraction=math.fsum(e.fraction for e in runs) / len(runs),
        stroke=np.empty(0),
        force=np.empty(0),
        seconds=math.fsum(e.seconds for e in runs),
        parts=tuple(runs),
    )
