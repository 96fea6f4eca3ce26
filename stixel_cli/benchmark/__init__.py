"""The benchmark of extended target trackers, `stixel bench`; docs/benchmark-1.0.md describes it."""
