"""Vibro-impact dynamics of beams, and the design of impact dampers on them."""
