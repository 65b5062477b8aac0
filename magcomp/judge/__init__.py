"""MotorFit → Verdict: held-out proof, uncertainty in degrees, and reasons a pilot understands."""

from magcomp.judge.evidence import field_residual
from magcomp.judge.heading_error import apart_at_rest, heading_errors, largest_shift, turning
from magcomp.judge.judge import judge
from magcomp.judge.present import judge_present
from magcomp.judge.thresholds import Thresholds

__all__ = [
    "Thresholds",
    "apart_at_rest",
    "field_residual",
    "heading_errors",
    "judge",
    "judge_present",
    "largest_shift",
    "turning",
]
