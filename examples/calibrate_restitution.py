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

import femimpact as fi
from femimpact.study.demo import NEAR, PUBLISHED, ScanPlan, median_scan, paper_study, scan_both_starts


def main(plan: ScanPlan | None = None) -> dict[str, fi.RestitutionScan]:
    """Scan the restitution from both starts: medians."""
    found = scan_both_starts(paper_study(), plan or ScanPlan(), lambda _what, _share: None)
    return {start: median_scan(scans) for start, scans in found.items()}


if __name__ == "__main__":
    scans = main()
    names = {"base": "at rest relative to the base", "space": "at rest in the inertial frame"}
    target = (PUBLISHED["frequency_ball_experiment"], PUBLISHED["amplitude_ratio"])
    for start, scan in scans.items():
        print(f"{names[start]}:")
        print("  restitution   peak (Hz)   amplitude ratio   misfit")
        rows = zip(scan.restitution, scan.peak_frequency, scan.amplitude_ratio, scan.misfit(*target), strict=True)
        for row in rows:
            print("  {:11.2f}   {:9.2f}   {:15.1f}   {:6.1f}".format(*row))
        near = ", ".join(f"{e:.2f}" for e in scan.restitution[scan.misfit(*target) < NEAR])
        print(f"  near the published resonance (misfit below {NEAR:g}): {near or 'none'}")
    labelled = [(names[start], scan) for start, scan in scans.items()]
    axes = fi.figures.restitution_scan(labelled, *target)
    print("wrote", fi.figures.save_figure(axes, "calibrate_restitution.png"))
