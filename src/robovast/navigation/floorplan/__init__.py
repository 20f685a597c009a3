"""Floor plans: the modelling language, and the map, the mesh and the graph that follow from it."""
