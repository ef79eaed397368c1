"""The compiled time loop of the Newmark family: arrays and numbers only.

Cases run side by side: every state array carries the case axis last and the innermost loops run
over cases, so that the compiler puts them in SIMD lanes. Contact is rare and scalar: one equation
per pair, solved only in the cases that touch. No fastmath: a case gets the same bits whatever runs
beside it.
"""
