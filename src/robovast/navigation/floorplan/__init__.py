"""Floor plans: the modelling language, and the maps, meshes and graphs made from them."""
