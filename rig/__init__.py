"""The operator's side in five rooms: ui > studies > run > drives and analysis; the upper import the lower.

Nothing loose but errors.py.
"""
