"""The operator's side in five rooms: ui > studies > run > drives and analysis.

A room imports rooms to its right only. Outside the rooms there is errors.py alone.
"""
