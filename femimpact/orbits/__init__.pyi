from femimpact.orbits.branch import Bifurcation as Bifurcation
from femimpact.orbits.branch import Branch as Branch
from femimpact.orbits.orbit import PeriodicOrbit as PeriodicOrbit
from femimpact.orbits.search import find_orbits as find_orbits
from femimpact.orbits.search import two_impact_orbits as two_impact_orbits
from femimpact.orbits.switching import switch_branch as switch_branch
