"""The reference renderers: projections of thesis chapter 4 with the regulation schemes of 4.2 and (5.21), set
stabilisation of chapter 7, and two projections beyond the thesis whose force is the gradient of a potential.

The names that the framework finds are factories. They have variants by regulation scheme and representation, which
are written into a renderer's name as BASE[+SCHEME][@REPRESENTATION], such as `constraint+pp-pd@curve`.
"""

from hapticeval.renderers.family import (
    CELL_KNOB,
    FLOW_KNOBS,
    FRONT_KNOB,
    GRID_KNOB,
    NODES_KNOB,
    SAMPLES_KNOB,
    VERTICES_KNOB,
    ProjectiveFamily,
    set_stabilisation,
)

minimum_distance = ProjectiveFamily(
    summary="nearest surface point, thesis (4.2), on the exact curve; pops through medial axes",
    project="nearest:nearest",
    representations=("curve", "polygon", "level-set", "lut"),
    representation="curve",
    bends=True,
    space=True,
    offered_knobs={
        "polygon": {"vertices": VERTICES_KNOB},
        "level-set": {"grid": GRID_KNOB},
        "lut": {"cell": CELL_KNOB},
    },
    independent="sampled:nearest",
    independent_knobs={"samples": SAMPLES_KNOB},
)
"""The minimum distance renderer."""

constraint = ProjectiveFamily(
    summary="god-object or proxy, thesis (4.3), on a polygon of 40 vertices; never passes through a face",
    project="god_object:god_object",
    representations=("curve", "polygon"),
    representation="polygon",
    refused="the constraint projection needs a boundary to slide on, and a level set has none",
    space=True,
    offered_knobs={"polygon": {"vertices": VERTICES_KNOB}},
    independent="sampled:god_object",
    independent_knobs={"samples": SAMPLES_KNOB},
)
"""The constraint renderer."""

conformal = ProjectiveFamily(
    summary="through the conformal map to the disk, thesis (5.17) and 8.2.1, with (5.21); no pop-through inside",
    project="disk:by_conformal_map",
    representations=("curve", "lut"),
    representation="curve",
    regulation="transversal",
    refused="the conformal map is that of the exact boundary",
    offered_knobs={"curve": {"nodes": NODES_KNOB}, "lut": {"cell": CELL_KNOB}},
)
"""The conformal renderer."""

mapping = ProjectiveFamily(
    summary="through the curve shortening flow's map to the disk, thesis chapter 5; refuses models that it cannot map",
    project="disk:by_flow_map",
    representations=("curve", "lut"),
    representation="curve",
    regulation="transversal",
    refused="the flow is that of the exact boundary",
    offered_knobs={"curve": FLOW_KNOBS, "lut": {"cell": CELL_KNOB}},
    independent="disk:by_tracked_front",
    independent_knobs={"nodes": FRONT_KNOB},
)
"""The mapping renderer."""

homothetic = ProjectiveFamily(
    summary="along the ray from the centre of a star-shaped model; continuous, passive, its stiffness varies",
    project="level_curves:homothetic",
    representations=("curve", "polygon", "lut"),
    representation="curve",
    regulation="gradient",
    refused="a ray meets a boundary, and a level set has none",
    potential=True,
    space=True,
    offered_knobs={"polygon": {"vertices": VERTICES_KNOB}, "lut": {"cell": CELL_KNOB}},
    independent="sampled:homothetic",
    independent_knobs={"samples": SAMPLES_KNOB},
)
"""The homothetic renderer."""

combescure = ProjectiveFamily(
    summary="along level curves with the surface's normals; continuous, passive, K uniform down to a depth",
    project="level_curves:combescure",
    representations=("curve", "lut"),
    representation="curve",
    regulation="gradient",
    refused="its level curves are parallel to the exact boundary",
    potential=True,
    space=True,
    offered_knobs={"lut": {"cell": CELL_KNOB}},
    independent="sampled:combescure",
    independent_knobs={"samples": SAMPLES_KNOB},
)
"""The Combescure renderer."""

__all__ = ["combescure", "conformal", "constraint", "homothetic", "mapping", "minimum_distance", "set_stabilisation"]
