"""How the embedded detector is made: random simulated images, their labels, a small network and its training.

Nothing here runs in the product. ``network``, ``loss`` and ``train`` need PyTorch (``pip install '.[train]'``).
"""
