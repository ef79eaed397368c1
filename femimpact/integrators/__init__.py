"""Time integration: the compiled loop, its methods, and the verb that runs them."""
