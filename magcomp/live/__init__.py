"""A live vehicle from connecting to writing, without a user interface."""
