"""magcomp at MAVProxy's prompt: `module load magcomp`. See docs/mavproxy.md.

MAVProxy holds the link; it is made a transport (`carried.py`), so that everything that works on a
link of magcomp's own works on it: the session, the fit, the write with its proof. `commands.py` are
the words of the prompt, `module.py` is what MAVProxy loads.
"""
