"""The study file, what a run of it does, its directory of results, and the demo."""
