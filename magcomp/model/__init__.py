"""The frozen data that travels along the road.

bytes → Recording → Samples → MotorFit → Verdict → ParameterSet → vehicle.
"""

from magcomp.model.parameters import ParameterSet
from magcomp.model.recording import (
    BoolArray,
    FloatArray,
    ParameterChange,
    ParameterHistory,
    ReadReport,
    Recording,
    Series,
    Vehicle,
)

__all__ = [
    "BoolArray",
    "FloatArray",
    "ParameterChange",
    "ParameterHistory",
    "ParameterSet",
    "ReadReport",
    "Recording",
    "Series",
    "Vehicle",
]
