"""The directory of results: what is written into it and read from it."""
