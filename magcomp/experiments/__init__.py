"""The paper's experiments, carried out again on simulated and recorded vehicles.

Here, and only here, the truth of a simulation is read: to judge, never to fit.
"""
