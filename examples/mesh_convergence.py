r"""
How many elements does a frequency need?
========================================

Cubic Hermite elements converge with the fourth power of the element length h in the frequencies,

.. math::

   |f_h - f|/f \sim C\,(h/L)^4,

until rounding ends the gain. Frequencies are read from a factor G of the stiffness, :math:`\mathbf K = \mathbf G^T
\mathbf G`, whose condition number is the root of that of K, so that the floor lies near 1e-12 instead of growing with
the fourth power of the number of elements.
"""

from __future__ import annotations

import femimpact as fi
from femimpact.app.demo import paper_study


def main(
    elements: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2000),
) -> fi.convergence.ConvergenceTable:
    """Natural frequencies of the paper's beam over the mesh."""
    return fi.convergence.converge_elements(paper_study().structure, elements, modes=4)


if __name__ == "__main__":
    table = main()
    print(table)
    print("wrote", fi.figures.save_figure(fi.figures.convergence(table), "mesh_convergence.png"))
