"""Models: their exact curves, and the polygons and level sets that renderers hold of them."""
