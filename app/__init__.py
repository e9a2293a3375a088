"""The service, the 3D scene, the background jobs and the command line."""
