"""How stiff a scene may be before the sampled loop loses stability (thesis 2.6, 8.2.4)."""
