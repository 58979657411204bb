"""Charts as plain data, made once from a run; Matplotlib and the page only render them."""
