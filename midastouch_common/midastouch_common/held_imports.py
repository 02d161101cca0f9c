"""trimesh, which takes whatever is raised while it is imported, also by Ctrl-C, for a missing module and goes on."""

from .stop_signals import held

with held():
    import trimesh

__all__ = ["trimesh"]
