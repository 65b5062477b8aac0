"""Parts of screens: each draws a frozen value it is given, and knows nothing else."""
