"""The study file, and what is prepared from it."""
