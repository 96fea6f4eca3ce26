"""Studies: the research questions, each a few sweeps and a report over their runs."""
