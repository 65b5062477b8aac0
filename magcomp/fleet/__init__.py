"""Many logs: every one read once, and put together by aircraft."""
