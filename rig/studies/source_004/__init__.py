"""Experiments of source 004, repeated on the bench: published findings beside our figures.

findings.toml holds the findings, rule.py the rule of agreement, runs.py one run, study.py all.
Imports rig.run, rig.analysis and lower layers; nothing of rig.ui.
"""
