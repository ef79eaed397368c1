from femimpact.fem.discretisation import Discretisation as Discretisation
from femimpact.fem.discretisation import discretise as discretise
from femimpact.fem.mesh import Mesh as Mesh
from femimpact.fem.mesh import graded_mesh as graded_mesh
from femimpact.fem.mesh import random_mesh as random_mesh
