"""A structure and its motion as bodies in space."""
