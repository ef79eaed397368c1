from femimpact.system.added_terms import add_terms as add_terms
from femimpact.system.contact_pair import ContactPair as ContactPair
from femimpact.system.hermite import Reaction as Reaction
from femimpact.system.matrices import read_matrix as read_matrix
from femimpact.system.modes import Modes as Modes
from femimpact.system.modes import with_damping as with_damping
from femimpact.system.reduction import truncation_notes as truncation_notes
