"""Camera calibration: the tour through the points, the fit, and the calibration file.

Imports lower layers, rig/run/config.py, cameras.py and load_model.py.
"""
