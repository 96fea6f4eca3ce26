"""The study of the thesis's experiment."""
