"""Errors of the calibration side: traces, curves, materials and output folders."""

from __future__ import annotations

from mpm.scene.errors import CutcalError
from mpm.scene.errors import OutputError as OutputError


class TraceError(CutcalError):
    """A force trace that cannot be read, or in which no cut can be found."""


class CurveError(CutcalError, ValueError):
    """Force curves that cannot be filtered, compared or rated as given."""


class MaterialError(CutcalError):
    """A food or a material property that is unknown, incomplete or out of its range."""


class PublishedError(CutcalError):
    """A file of published numbers that is incomplete, contradicts itself or cannot be fitted as asked."""


class RegressionError(CutcalError):
    """A recorded force curve that is missing or damaged, or that cannot be replaced."""


class DocumentError(OutputError):
    """A JSON document of a finished run that is missing, damaged or incomplete."""


class ClusterError(CutcalError):
    """A Dask cluster that cannot be reached, has no workers, or such as cannot be used."""


class ShapeError(CutcalError):
    """A photograph, a mesh or a profile that gives no outline which can be simulated."""
