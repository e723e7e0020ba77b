"""Studies beside the verdicts: what accuracy costs, how stiff a scene may be, where projections jump, integrators."""
