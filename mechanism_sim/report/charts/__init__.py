"""Charts as plain data, made once from a run; Matplotlib and the page only render them.

What shares a panel, colours, dashes, ranges and legends are decided here once. Python's side of
plotly is left out: its checks of every property took longer than the numbers.
"""
