"""Camera calibration: the tour through the points, the fit, and the calibration file.

Imports lower layers, rig/run/config.py and rig/run/load_model.py.
"""
