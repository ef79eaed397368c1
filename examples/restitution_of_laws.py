r"""
Which restitution do the contact laws achieve?
==============================================

Laws that add damping to Hertz's force differ in the factor d that they take for a restitution e:

.. math::

   N = k\,p^{3/2}\,\max(0,\; 1 + d\,\dot p/v_0) .

Every d has one exact restitution, the root of :math:`d\,(1 + e) = \ln[(1 + d)/(1 - e\,d)]`. How far is it from the
restitution that was asked for?
"""

from __future__ import annotations

import numpy as np

import femimpact as fi

ASKED = np.linspace(0.05, 1.0, 39)
LAWS = {
    "Hunt and Crossley": fi.HuntCrossley,
    "Lankarani and Nikravesh": fi.contact.LankaraniNikravesh,
    "Flores et al.": fi.contact.Flores,
    "exact (Gonthier et al.)": fi.contact.GonthierCarvalhoMartins,
}


def main(asked=ASKED, mass: float = 3e-3, speed: float = 0.2) -> dict[str, np.ndarray]:
    """Restitution (1) of one collision for each one asked for, by the law."""
    return {
        name: np.array([fi.collide(law(stiffness=1e6, restitution=e), mass, speed).restitution for e in asked])
        for name, law in LAWS.items()
    }


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.rcParams.update(fi.figures.STYLE)
    axes = plt.figure(layout="constrained").subplots()
    for (name, achieved), style in zip(main().items(), ("--", "-.", ":", "-"), strict=True):
        axes.plot(ASKED, achieved, style, label=name)
    axes.set(xlabel="restitution asked for (1)", ylabel="restitution achieved (1)")
    axes.legend(frameon=False)
    print("wrote", fi.figures.save_figure(axes, "restitution_of_laws.png"))
