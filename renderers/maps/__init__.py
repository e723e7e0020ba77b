"""One-to-one transformations of a model to the unit disk: by curve shortening flow, and conformal."""
