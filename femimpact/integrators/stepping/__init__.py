"""The Newmark family and Moreau-Jean: methods that take steps, whose loop runs in the compiled core.

Cases run side by side: every state array of the loop carries the case axis last, and the core takes eight cases at a
time in SIMD registers. Contact is rare and scalar: one equation per pair, solved only in the cases that touch. No
fastmath: a case gets the same bits whatever runs beside it.
"""
