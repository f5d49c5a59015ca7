"""Verdicts on fitted parameters as people read them: one word for each, in terminal, reports and glossary."""

from __future__ import annotations

VERDICT_WORDS = {
    "identified": "identified",
    "weak": "weak",
    "one_sided": "one-sided",
    "only_as_product": "only as a product",
    "not_seen": "not seen",
    "at_bound": "at its bound",
    "at_limit": "at its natural limit",
    "unknown": "not determined",
}
"""What a reader sees in place of each verdict of documents and tables, in the order of what the trace says."""


def verdict_word(verdict: str) -> str:
    """A verdict on a parameter in the words of the glossary; one that is none of them as it is."""
    return VERDICT_WORDS.get(verdict, verdict)
