"""Images of the scene: the ray caster and the sensors' noise."""
