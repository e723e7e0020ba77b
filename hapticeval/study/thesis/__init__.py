"""What the thesis shows, item by item: what shows it here, and whether it comes out as printed."""
