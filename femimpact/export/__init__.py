"""Files and pictures of results: the only rooms that know pyvista, matplotlib and file formats."""
