"""Linear-Gaussian algebra of a design: what several tests say together of the parameters.

Each test has rows y = J z + e of unit variance where its errors are independent, beside what it leaves open (tare,
drift, lag, gain, width, plates) and what the model misses. With all of these integrated out,

    V = 1 + sum_k c_k c_k^T + (model error that tests share),    I = J^T V^-1 J,    covariance = (P + I)^-1,

where P is the information of the literature's priors. The expected posterior covariance of a linear Gaussian model does
not depend on what will be measured, which is why a test can be judged before it is made (Chaloner and Verdinelli 1995,
Stat. Sci. 10:273; Lindley 1956, Ann. Math. Stat. 27:986).

Simulated curves have a noise, and a derivative by differences carries it: alone it would feign a knowledge of
parameters that the test does not see. What it feigns on average is taken away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mpm.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class LinearTest:
    """A test as a linear Gaussian measurement.

    Attributes:
        slopes: Rows by internal coordinates, in standard deviations of the rows' own errors [-], (n, p).
        feigned: What the noise of the runs adds to each column of ``slopes`` [-], (n, p); its size, not its sign.
        columns: Rows by one prior standard deviation of what the test leaves open [-], each (n,). Tests have those of
            one name in common.
        model_error: Part of each row's standard deviation that is error of the model [-], (n,).
        model: Tests of one name have the same error of the model, row by row; empty: of its own.
    """

    slopes: FloatArray
    feigned: FloatArray
    columns: Mapping[str, FloatArray] = field(default_factory=dict)
    model_error: FloatArray = field(default_factory=lambda: np.zeros(0))
    model: str = ""


def information(tests: Sequence[LinearTest]) -> FloatArray:
    """What tests say together of the parameters, less what the noise of the runs feigns.

    Args:
        tests: The tests, at least one.

    Returns:
        The information in internal coordinates (p, p), symmetric; of noise alone it may be slightly negative.
    """
    precision = np.linalg.inv(_covariance(tests))
    slopes = np.vstack([t.slopes for t in tests])
    whole = slopes.T @ precision @ slopes
    first = 0
    for t in tests:
        part = slice(first, first + len(t.slopes))
        first = part.stop
        whole = whole - np.diag(np.einsum("ij,ik,kj->j", t.feigned, precision[part, part], t.feigned))
    return 0.5 * (whole + whole.T)


def pulled(tests: Sequence[LinearTest], rows: FloatArray) -> FloatArray:
    """What differences between record and simulation pull the parameters with, J^T V^-1 y.

    Args:
        tests: The tests, at least one.
        rows: Record less simulation in the rows of all tests, one after the other [-], (n,).

    Returns:
        Half the negative gradient of chi-square in internal coordinates (p,).
    """
    slopes = np.vstack([t.slopes for t in tests])
    out: FloatArray = slopes.T @ np.linalg.solve(_covariance(tests), rows)
    return out


def posterior(prior: FloatArray, said: FloatArray) -> FloatArray:
    """Covariance (p, p) after what was said, where that is more than nothing.

    Args:
        prior: Covariance before [-], (p, p).
        said: Information that is added [-], (p, p); its negative parts are noise and count as nothing.

    Returns:
        The covariance, nowhere larger than before.
    """
    root = np.linalg.cholesky(prior)
    values, vectors = np.linalg.eigh(root.T @ said @ root)
    turned = root @ vectors
    out: FloatArray = turned @ np.diag(1.0 / (1.0 + np.maximum(values, 0.0))) @ turned.T
    return out


def gained_bits(before: FloatArray, after: FloatArray) -> float:
    """Expected information that a test gains on all parameters, half the fall of the log determinants [bit]."""
    return 0.5 * float(np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1]) / float(np.log(2.0))


def _covariance(tests: Sequence[LinearTest]) -> FloatArray:
    """Covariance V of the rows of all tests, one after the other."""
    sizes = [len(t.slopes) for t in tests]
    ends = np.cumsum([0, *sizes])
    parts = [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    out = np.eye(int(ends[-1]))
    for name in dict.fromkeys(name for t in tests for name in t.columns):
        column = np.concatenate([t.columns.get(name, np.zeros(n)) for t, n in zip(tests, sizes, strict=True)])
        out += np.outer(column, column)
    for i, one in enumerate(tests):
        for j, other in enumerate(tests):
            if i != j and one.model and one.model == other.model:
                out[parts[i], parts[j]] += np.diag(one.model_error * other.model_error)
    return out
