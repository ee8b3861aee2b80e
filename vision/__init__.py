"""Vision: pixels in, cable angle out; only task.py and __main__.py know the wire.

Imports comms only; the estimators import nothing else of ours.
"""
