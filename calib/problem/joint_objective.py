"""Several traces fitted at once: shared flesh, and what each specimen has of its own.

A parameter named ``R_skin@cut2`` belongs to the trace ``cut2`` alone; one without ``@`` is shared by all.  Data rows of
the traces stand one after the other, then the priors of all parameters, each once.  A joint evaluation is one simulation
for each trace.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.problem.objective import Case, Objective, Trial
from calib.problem.parameters import Parameter, ParameterSet, own, plain
from calib.simulation.evaluation import Evaluation, Evaluator
from mpm.arrays import FloatArray


def residual(
    objective: JointObjective | Objective, curves: Sequence[FloatArray], fractions: Sequence[float], z: FloatArray
) -> FloatArray:
    """All rows of an objective: data of each trace in turn, then priors.

    Args:
        objective: The objective.
        curves: Smoothed force of each trace's simulation [N] (n,).
        fractions: Part of its stroke that each completed [-].
        z: Internal coordinates (p,).
    """
    return residuals(objective, [m[None] for m in curves], np.array(fractions)[:, None], z[None])[0]


def residuals(
    objective: JointObjective | Objective, curves: Sequence[FloatArray], fractions: FloatArray, z: FloatArray
) -> FloatArray:
    """The same of q materials at once (q, rows).

    Args:
        objective: The objective.
        curves: Smoothed force of each trace's simulations [N], each (q, n).
        fractions: Part of its stroke that each completed [-], by trace (t, q).
        z: Internal coordinates (q, p).
    """
    data = [c.objective.data_residuals(m, f) for c, m, f in zip(objective.cases, curves, fractions, strict=True)]
    return np.concatenate([*data, objective.parameters.prior_residual(z)], axis=1)


@dataclass(frozen=True)
class JointObjective:
    """Residual vector and chi-square of joint evaluations.

    Attributes:
        parameters: All parameters with their priors.
        cases: One per trace.
    """

    parameters: ParameterSet
    cases: tuple[Case, ...]

    @classmethod
    def of(cls, objectives: Mapping[str, Objective], shared: Sequence[str]) -> JointObjective:
        """Join objectives by the name of their trace.

        Args:
            objectives: Each over the properties that its simulation takes.
            shared: Which of them are the same for all traces; priors and start values are the first one's.
        """
        names: dict[str, int] = {}
        items: list[Parameter] = []
        cases = []
        for trace, objective in objectives.items():
            index = []
            for p in objective.parameters:
                name = p.name if p.name in shared else own(p.name, trace)
                if name not in names:
                    names[name] = len(items)
                    items.append(replace(p, name=name))
                index.append(names[name])
            cases.append(Case(trace, objective, np.array(index)))
        return cls(ParameterSet(tuple(items)), tuple(cases))

    @property
    def effective_rows(self) -> float:
        """Effective number of independent data, all traces together [-]."""
        return sum(c.objective.effective_rows for c in self.cases)

    def trial(self, evaluation: Evaluation, *, coarse: bool = False, stage: str = "design") -> Trial:
        """Curves and residual vector of a joint evaluation."""
        z = self.parameters.to_vector(evaluation.parameters)
        parts = tuple(
            c.objective.trial(e, coarse=coarse, stage=stage) for c, e in zip(self.cases, evaluation.parts, strict=True)
        )
        fractions = [e.completed for e in evaluation.parts]
        rows = residual(self, [t.curve for t in parts], fractions, z)
        return Trial(z, evaluation, np.concatenate([t.curve for t in parts]), rows, coarse, stage, parts)


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
        for case, evaluator in zip(self.objective.cases, self.evaluators, strict=True):
            own_names = [plain(names[k]) for k in case.index]
            asked = [{n: values[names[k]] for n, k in zip(own_names, case.index, strict=True)} for values in batch]
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
