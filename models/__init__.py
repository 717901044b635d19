"""Floor 1: the mathematics. Camera, road map, segmentation, distance, constraints, motion, particle filter.

Nothing here knows a log, a viewer, a clock or another program's files.
"""
