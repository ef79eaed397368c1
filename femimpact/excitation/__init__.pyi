from femimpact.excitation.drives import Drives as Drives
from femimpact.excitation.excitation import LineLoad as LineLoad
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial as PiecewisePolynomial
from femimpact.excitation.record_files import write_record as write_record
from femimpact.excitation.sums import Sum as Sum
