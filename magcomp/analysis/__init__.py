"""Recording → Analysis: fit, judge and choose, without a user interface."""

from magcomp.analysis.analyse import Options, analyse, check, regressor_in_force
from magcomp.analysis.emit import parameter_set

__all__ = ["Options", "analyse", "check", "parameter_set", "regressor_in_force"]
