"""One HTML file for the results of a run: conclusions, drawings, charts, tables, and a player of the motion."""
