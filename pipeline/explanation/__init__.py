"""Explanation of a capture: what was looked at in each scan, and why it was refused."""

from .explain import explain_capture
from .records import ExplainedCandidate, ExplainedScan, Explanation

__all__ = ["ExplainedCandidate", "ExplainedScan", "Explanation", "explain_capture"]
