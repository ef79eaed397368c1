"""Files and pictures of results: the only modules that know pyvista, matplotlib and file formats."""
