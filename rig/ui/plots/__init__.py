"""Figures of runs, plans, laws, screws and studies; the only room that draws (matplotlib).

Imports everything but sim_rig.
"""
