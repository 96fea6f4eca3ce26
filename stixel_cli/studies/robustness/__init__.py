"""The studies of the trackers away from home: `robustness` and `robustness_real`."""
