"""The table of stages: it joins the functions of the science with the engine."""
