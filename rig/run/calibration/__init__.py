"""Camera calibration: the tour through the points, and the calibration file.

Imports lower layers, rig/run/config.py and rig/run/load_model.py.
"""
