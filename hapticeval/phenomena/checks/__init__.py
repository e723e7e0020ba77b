"""The checks: one in a module of its name, or a family of effects in one."""
