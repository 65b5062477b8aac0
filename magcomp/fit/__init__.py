"""Samples → MotorFit: three ways the same number is found."""

from magcomp.fit.auto import (
    LEAST_READINGS,
    METHODS,
    best_form,
    fit,
    fit_alike,
    refit,
    require_readings,
)
from magcomp.fit.beside import likely_beside
from magcomp.fit.ellipsoid import Ellipsoids, fit_ellipsoid, fit_ellipsoids
from magcomp.fit.flight import Problem
from magcomp.fit.folds import folds
from magcomp.fit.levels import centres_of_flight
from magcomp.fit.line import line_through, orthogonal_line, paper_line, weighted_line
from magcomp.fit.numerics import require_finite, solvable
from magcomp.fit.residual import departures, residuals, spread
from magcomp.fit.sweep import is_still

__all__ = [
    "LEAST_READINGS",
    "METHODS",
    "Ellipsoids",
    "Problem",
    "best_form",
    "centres_of_flight",
    "departures",
    "fit",
    "fit_alike",
    "fit_ellipsoid",
    "fit_ellipsoids",
    "folds",
    "is_still",
    "likely_beside",
    "line_through",
    "orthogonal_line",
    "paper_line",
    "refit",
    "require_finite",
    "require_readings",
    "residuals",
    "solvable",
    "spread",
    "weighted_line",
]
