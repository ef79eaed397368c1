"""The Newmark family and Moreau-Jean: methods that take steps, with their compiled loop beside them.

Cases run side by side: every state array of the loop carries the case axis last and its innermost loops run
over cases, so that the compiler puts them in SIMD lanes. Contact is rare and scalar: one equation
per pair, solved only in the cases that touch. No fastmath: a case gets the same bits whatever runs
beside it.
"""
