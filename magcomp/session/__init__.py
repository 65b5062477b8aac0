"""Collect → fit → judge → write, without a user interface."""

from magcomp.session.analyse import Options, analyse, check, regressor_in_force
from magcomp.session.emit import parameter_set
from magcomp.session.refresh import refresh

__all__ = ["Options", "analyse", "check", "parameter_set", "refresh", "regressor_in_force"]
