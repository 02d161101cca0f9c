"""Common code of every package of the workspace: errors, poses, meshes, files, and the base of its nodes."""
