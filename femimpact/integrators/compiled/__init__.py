"""How functions become machine code: the only modules that touch the insides of numba and llvmlite."""
