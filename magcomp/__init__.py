"""magcomp finds how a multirotor's motor currents shift its compass, and what cancels the shift."""

__version__ = "0.1.0"


def init(mpstate: object) -> object:
    """Be a module of MAVProxy: what its ``module load magcomp`` calls. See docs/mavproxy.md."""
    # MAVProxy looks for this name in the package; nobody else pays for an import.
    import importlib  # noqa: PLC0415

    return importlib.import_module("magcomp.mavproxy.module").load(mpstate)
