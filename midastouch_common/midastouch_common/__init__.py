"""What every package of the workspace shares: errors, poses, meshes, files, and the base of its nodes."""
