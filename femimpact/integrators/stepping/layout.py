"""Rows of the arrays that the compiled loop over steps is handed, by name; the arrays are the tuples of `core.steps`.

The case axis comes last: cases lie side by side, one alone or in packs of `WIDTH`.
"""

WIDTH = 8
"""Cases in a pack."""

# rows of Cycles.last (., cases): displacement (m) and velocity (m/s) of the observed place
LAST, LAST_RATE = range(2)
# rows of Motion.ball (., pairs, cases); y and x = y - w are relative to the base, FORCE acts on the structure;
# RATE and RATE_BEFORE are kept only where a method looks ahead
Y, Y_RATE, Y_ACCELERATION, X, X_BEFORE, FORCE, Y_BEFORE, RATE, RATE_BEFORE = range(9)
# rows of Motion.drive (., cases); the drive's history is SCALE times the sine; BASE is its value at the step's
# end, ACTING that in the balance of the step; TRAVEL is its amplitude as a displacement of the base (m), TRAVEL_RATE
# as a velocity (m/s), and OBSTACLE_RATE(_BEFORE) the velocity of stops fixed in space
(
    SINE, COSINE, TURN_SINE, TURN_COSINE, PHASE, PHASE_STEP, SCALE, BASE, BASE_BEFORE, ACTING, TRAVEL, TRAVEL_RATE,
    OBSTACLE_RATE, OBSTACLE_RATE_BEFORE,
) = range(14)  # fmt: skip
# rows of Motion.ledger (., cases); LOAD_BEFORE is load @ q at the last step; REFINED to OWN_LOSS set aside what a
# refined case has summed by itself; HELD is the potential of the constant load at the start
WORK, STRUCTURE_LOSS, CONTACT_LOSS, LOAD_BEFORE, REFINED, OWN_WORK, OWN_LOSS, HELD = range(8)
# rows of Pairs.constants (., pairs, cases); a stop has no mass (its energy) and no mobility (1/m);
# SHARE of the drive that acts as an acceleration of the base on the ball
(
    MASS, MOBILITY, GAP_PLUS, GAP_MINUS, STIFFNESS, DAMPING, EXPONENT, RESTITUTION, FREE_STIFFNESS, ACCELERATION, SHARE,
    FREE_DAMPING,
) = range(12)  # fmt: skip
# rows of Motion.touch (., pairs, cases); BUSY: the pair must be looked at in every step
BUSY, OPEN, SIDE, START, APPROACH, IMPULSE, PEAK, DURATION, LOSS, NORMAL, DISSIPATIVE, REBOUND = range(12)
