"""The experiment's engine: a graph of cached stages, run by workers. Knows no stixel."""
