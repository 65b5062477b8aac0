"""``python -m magcomp`` is the command ``magcomp``."""

from magcomp.cli import main

if __name__ == "__main__":
    main()
