"""Extended target trackers: from scans to pose, rates and shape with covariance."""
