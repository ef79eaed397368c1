"""The mesh, and the assembly of a structure on it by scikit-fem."""
