"""The built-in contact laws, one in each file."""
