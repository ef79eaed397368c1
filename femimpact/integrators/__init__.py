"""Time integration: the methods, and the verb that runs them in the compiled core."""
