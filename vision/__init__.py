"""Vision: cable angle from pixels; only task.py and __main__.py use the message types.

Imports comms only; the estimators import no other package of the project.
"""
