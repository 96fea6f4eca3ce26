"""The border: what comes from outside of this process, by name or as a file."""
