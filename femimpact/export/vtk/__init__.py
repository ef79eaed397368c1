"""Files for ParaView: mode shapes and deflections of a solid beam, with fields for colours and arrows."""

from femimpact.export.vtk.writers import write_deflection, write_mode, write_modes

__all__ = ["write_deflection", "write_mode", "write_modes"]
