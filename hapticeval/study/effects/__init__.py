"""What effects cost: a tick with and without those that a scene calls for, and the code that was compiled for it."""
