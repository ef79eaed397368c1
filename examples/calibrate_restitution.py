r"""
Which restitution gives the paper's resonance?
==============================================

The restitution e of the ball against its box is the one unknown that decides the response curve with the ball. For
every e of a scan the contact is a Kelvin-Voigt pair with the same contact time,

.. math::

   e = \exp\Bigl(-\frac{2 z \arccos z}{\sqrt{1 - z^2}}\Bigr), \qquad z = \frac{c}{2\sqrt{k\,m_\mathrm{eff}}},

and the sweep of the paper is run from rest. Each e is judged by the distance of its largest peak from the published
4.95 Hz and from an amplitude five times below the true peak without the ball. Two starts, at rest relative to the base
and at rest in the inertial frame, are scanned: where several motions exist, the start chooses between them. The motions
are chaotic: what is shown are medians over several places of the ball in its box.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import xarray

import femimpact as fi
from femimpact.app.demo import NEAR, RESTITUTION, ScanPlan, misfit, paper_study, scan_restitution
from femimpact.app.study.prepared import prepare


def main(plan: ScanPlan | None = None) -> xarray.Dataset:
    """A parameter study over the restitution from both starts: the largest peaks, medians and ranges."""
    return scan_restitution(prepare(paper_study(), ("sweep",)), plan or ScanPlan(), lambda _what, _share: None)


if __name__ == "__main__":
    scan = main()
    names = {"base": "at rest relative to the base", "space": "at rest in the inertial frame"}
    figure, axes = plt.subplots(2, figsize=(8.0, 7.4), layout="constrained")
    for axis, (start, words) in zip(axes, names.items(), strict=True):
        one = scan.sel({"base.start": start})
        distance = misfit(one["peak_frequency"], one["amplitude_ratio"]).values
        print(f"{words}:")
        print("  restitution   peak (Hz)   amplitude ratio   misfit")
        columns = (one[RESTITUTION], one["peak_frequency"], one["amplitude_ratio"], distance)
        for row in zip(*columns, strict=True):
            print("  {:11.2f}   {:9.2f}   {:15.1f}   {:6.1f}".format(*map(float, row)))
        near = ", ".join(f"{e:.2f}" for e in one[RESTITUTION].values[distance < NEAR])
        print(f"  near the published resonance (misfit below {NEAR:g}): {near or 'none'}")
        fi.figures.study(one, "amplitude_ratio", title=words, ax=axis)
    print("wrote", fi.figures.save_figure(axes, "calibrate_restitution.png"))
