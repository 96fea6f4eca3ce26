"""Everything that is said about more than one run: runs, a question, its answer."""
