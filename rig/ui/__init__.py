"""User interface: command line (cli/), figures (plots/) and the report of a run.

The only room that prints or uses typer, rich and matplotlib. Imports everything but sim_rig.
"""
