from femimpact.structure.structure import glue_impactors as glue_impactors
