"""Files and pictures of results: the only modules that use pyvista, matplotlib and file formats."""
