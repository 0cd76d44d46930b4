"""From a requirement on pointing to a chain: which sensors, blend, tracker and mirror meet it at the least cost.

`requirement` reads what is asked and what there is, `response` has the transfer functions of a filter, `spectra` what a
chain leaves, `search` tries all.
"""
