"""Where rows are simulated: in processes of this machine, or on a cluster.

An engine is a function of a function and items that yields an iterator of the results in the order
of the items. Which engine works, and with how many workers, changes no result.
"""
