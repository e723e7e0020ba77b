"""Renderers of the field beside the thesis, each written anew from its publication's equations, a module each.

They are found by name as any, and run only where they are named. Each module says what its equations predict, and
what was measured; `docs/renderers-of-the-field.md` has the table.
"""
