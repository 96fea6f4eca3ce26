"""Images of the scene: the ray caster, Filament and the sensors' noise."""
