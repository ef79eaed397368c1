"""One HTML file for the results of a run: conclusions, pictures, tables, and a player of the motion."""
