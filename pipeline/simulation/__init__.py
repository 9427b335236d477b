"""A small world to drive through: roads, scripted actors, a ray-cast VLP-16 and a rendered camera. Everything is a
function of the scenario and the time, so any moment can be computed in any order."""
