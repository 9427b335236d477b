"""A small world to drive through: roads, actors with scripts, a VLP-16 by ray casting and a drawn camera.

Everything is a function of the scenario and the time, so any moment can be asked for in any order.
"""
