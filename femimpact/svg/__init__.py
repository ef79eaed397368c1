"""Charts as HTML and SVG, for a notebook and for the report: elements, ticks, thinning and the chart itself."""
