"""Experiments of source 004, repeated on the bench: published findings beside our figures.

findings.toml holds the findings, rule.py the rule of agreement, runs.py one run,
free_modes.py the modes of several links, study.py all runs.
Imports rig.run, rig.analysis and lower layers; nothing of rig.ui.
"""
