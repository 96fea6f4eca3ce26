"""Configuration: schemas, composition with Hydra, messages for wrong input."""
