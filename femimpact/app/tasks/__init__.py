"""What a command does with a study: a run, a convergence study, orbits, a parameter study."""
