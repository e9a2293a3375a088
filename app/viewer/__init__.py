"""The 3D view: the car as viser nodes, and the way to it through the service's own address."""
