"""Figures and printed reports of finished runs. Importing it imports no matplotlib and no typesetter."""

from __future__ import annotations

from mpm.scene.errors import CutcalError

__all__ = ["ReportError"]


class ReportError(CutcalError):
    """A run folder from which no report can be made, or a report that cannot be written."""
