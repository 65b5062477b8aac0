"""magcomp finds how a multirotor's motor currents shift its compass, and what cancels the shift."""

__version__ = "0.1.0"
